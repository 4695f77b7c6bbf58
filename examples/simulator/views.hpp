// Rendered cameras: what `gestalt views` wrote, looked up by where a robot stands.
//
// The C interface takes features and has no renderer, for the mind is built without OpenCV. So hands are drawn and looked at
// beforehand, from many places, through the same perception that robots run; a simulated robot gets the frame of the place that is
// nearest to its own.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "robot.hpp"

namespace gestalt {

/// Where a camera is, seen from the hand: 0° faces the palm.
struct Place {
  double bearing_deg;
  double distance_m;
};

/// Where a robot is, seen from a hand whose palm looks along the y axis; in metres.
Place place_of(double x, double y);

class Views {
 public:
  /// Reads the CSV of `gestalt views`. Throws std::runtime_error, with the line, when it is none.
  explicit Views(const std::string& path);

  std::size_t hands() const { return hands_; }
  int gestures() const { return gestures_; }
  std::size_t frames() const { return frames_; }
  std::size_t features() const { return features_; }

  /// What is seen of a gesture from the nearest place; nothing where no hand was found, or where nobody looked.
  std::optional<Eye::Look> look(std::size_t hand, int gesture, Place from, std::size_t frame) const;

 private:
  std::size_t row(std::size_t hand, std::size_t place, int gesture, std::size_t frame) const;

  std::vector<Place> places_;
  std::vector<std::optional<Eye::Look>> looks_;
  std::size_t hands_ = 0, frames_ = 0, features_ = 0;
  int gestures_ = 0;
};

}  // namespace gestalt
