// The way of a robot with two wheels to a place: turn, then go, the faster the further.
#pragma once

#include <algorithm>
#include <cmath>

namespace gestalt {

struct Wheels {
  double left = 0;   ///< m/s
  double right = 0;  ///< m/s
};

/// The wheels' speeds of a robot at (x, y) that faces `angle` radians, on its way to (to_x, to_y); all in metres.
inline Wheels drive(double x, double y, double angle, double to_x, double to_y) {
  constexpr double FASTEST = 0.3, NEAR_ENOUGH = 0.02, HALF_AXLE = 0.075;
  const double away = std::hypot(to_x - x, to_y - y);
  if (away < NEAR_ENOUGH) return {};
  const double turn = std::remainder(std::atan2(to_y - y, to_x - x) - angle, 2 * 3.14159265358979323846);
  const double ahead = std::min(FASTEST, 2 * away) * std::max(0.0, std::cos(turn));
  const double aside = std::clamp(3 * turn * HALF_AXLE, -FASTEST / 2, FASTEST / 2);
  const auto within = [=](double speed) { return std::clamp(speed, -FASTEST, FASTEST); };
  return {within(ahead - aside), within(ahead + aside)};
}

}  // namespace gestalt
