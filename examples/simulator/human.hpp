// The human whom the robots stand around: what they show, and when. The same for all robots of a run, in every simulator.
#pragma once

#include <cstdint>
#include <optional>

#include "chance.hpp"
#include "views.hpp"

namespace gestalt {

class Human {
 public:
  /// A showing lasts so long in all; robots have time to move first, then a hand is held still.
  static constexpr std::uint64_t PERIOD = 12'000'000'000;
  static constexpr std::uint64_t MOVING = 6'000'000'000;
  static constexpr std::uint64_t GONE = 11'000'000'000;

  struct Showing {
    std::size_t hand;  ///< whose, in which light
    int gesture;
  };

  Human(std::uint64_t seed, std::size_t hands, int gestures) : seed_(seed), hands_(hands), gestures_(gestures) {}

  static std::uint64_t showing_at(std::uint64_t now) { return now / PERIOD; }
  static std::uint64_t into(std::uint64_t now) { return now % PERIOD; }

  /// What the showing of that number is of.
  Showing showing(std::uint64_t number) const {
    Chance chance(seed_, number);
    const auto gesture = static_cast<int>(chance.below(static_cast<std::uint64_t>(gestures_)));
    return {chance.below(hands_), gesture};
  }

  /// What is to be seen now.
  std::optional<Showing> shown(std::uint64_t now) const {
    if (into(now) < MOVING || into(now) >= GONE) return std::nullopt;
    return showing(showing_at(now));
  }

 private:
  std::uint64_t seed_;
  std::size_t hands_;
  int gestures_;
};

/// The camera of a robot that stands somewhere before that human.
class DrawnEye : public Eye {
 public:
  DrawnEye(const Views& views, const Human& human, std::uint64_t seed, std::uint32_t robot)
      : views_(views), human_(human), seed_(seed), robot_(robot) {}

  void stands_at(Place place) { place_ = place; }

  bool hand_is_shown(std::uint64_t now) override { return human_.shown(now) && sees(now, 0); }

  std::optional<Look> look(std::uint64_t now) override {
    // Two robots in one place do not see the same frame.
    return sees(now, Chance(seed_ ^ now, robot_).below(views_.frames()));
  }

 private:
  std::optional<Look> sees(std::uint64_t now, std::size_t frame) const {
    const auto shown = human_.shown(now);
    if (!shown) return std::nullopt;
    return views_.look(shown->hand, shown->gesture, place_, frame);
  }

  const Views& views_;
  const Human& human_;
  std::uint64_t seed_;
  std::uint32_t robot_;
  Place place_{0, 0};
};

}  // namespace gestalt
