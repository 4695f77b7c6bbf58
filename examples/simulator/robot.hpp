// The controller core: one robot that looks, decides and talks. It knows neither a simulator nor a clock nor chance.
//
//   every control step:   hear(…) each packet that came · step(…) · send(…) the one packet that goes
//
// enki.cpp and argos/ drive the same core; so can any other simulator, or the firmware of a robot.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mind.hpp"
#include "radio.hpp"

namespace gestalt {

/// What a robot's camera shows. Whoever has no camera computes features some other way, and hands them in here.
class Eye {
 public:
  virtual ~Eye() = default;

  struct Look {
    std::vector<float> features;
    float quality = 0;
  };

  /// Whether a hand is held still in front of the camera: what a motion detector says. A round begins with it.
  virtual bool hand_is_shown(std::uint64_t now) = 0;
  /// The next frame: the features of the hand on it, or nothing where none is found.
  virtual std::optional<Look> look(std::uint64_t now) = 0;
};

struct RobotConfig {
  std::uint32_t id = 1;            ///< from 1, unique in the swarm
  std::uint64_t seed = 1;          ///< of the run: the same for all its robots
  std::string model;               ///< file with the classifier
  std::string rounds = "{}";       ///< JSON: how rounds are held, as in a robot's configuration
  std::size_t packet_bytes = 64;   ///< the largest packet of the radio
  std::uint64_t frame_ns = 500'000'000;  ///< between two frames of the camera; a Foot-bot's takes two a second
};

/// What a robot holds of the newest round it knows.
struct Held {
  std::string round;           ///< its name, unique for ever
  std::optional<int> gesture;  ///< nothing where the round ended without one
  std::string label;
};

class Robot {
 public:
  explicit Robot(const RobotConfig& config);

  /// A packet arrived.
  void hear(std::uint64_t now, const std::uint8_t* packet, std::size_t length);
  /// Looks if it is time for a frame, and lets the mind do what is due.
  void step(std::uint64_t now, Eye& eye);
  /// The packet to send in this step; empty when there is none.
  Bytes send(std::uint64_t now) { return radio_.send(now); }

  std::optional<Held> held();
  bool is_open() { return mind_.is_open(); }
  std::string status() { return mind_.status(); }
  const Radio& radio() const { return radio_; }
  /// Envelopes that came whole and were none all the same.
  std::uint64_t refused() const { return refused_; }

 private:
  void watch(std::uint64_t now, Eye& eye);
  void look(std::uint64_t now, Eye& eye);
  void know(std::uint64_t now);

  RobotConfig config_;
  Mind mind_;
  Radio radio_;
  std::uint64_t next_frame_;
  bool shown_ = false;
  std::optional<std::uint64_t> opens_at_;
  std::vector<std::uint32_t> alive_, neighbours_;
  std::uint64_t refused_ = 0;
};

/// The value of a key of a JSON object, as it is written; empty where there is no such key. Not of the objects in it.
std::string json_field(const std::string& object, const std::string& key);

}  // namespace gestalt
