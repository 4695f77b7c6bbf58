#include "robot.hpp"

#include "chance.hpp"

namespace gestalt {

namespace {

/// How long it takes at most until a motion detector is sure that a hand is at rest: each robot's takes its own time.
constexpr std::uint64_t NOTICE = 300'000'000;

std::string settings(const RobotConfig& config) {
  return "{\"robot\": " + std::to_string(config.id) + ", \"boot\": 1, \"seed\": " + std::to_string(config.seed) +
         ", \"swarm\": \"simulated\", \"rounds\": " + config.rounds + "}";
}

}  // namespace

Robot::Robot(const RobotConfig& config)
    : config_(config), mind_(settings(config)), radio_(config.id, config.packet_bytes) {
  mind_.load_model(0, config.model);
  // Cameras that took their frames at the same instant would be one clock too good.
  next_frame_ = Chance(config.seed, config.id).below(config.frame_ns);
}

void Robot::hear(std::uint64_t now, const std::uint8_t* packet, std::size_t length) {
  const std::optional<Bytes> envelope = radio_.hear(now, packet, length);
  if (envelope && !mind_.received(now, *envelope)) refused_ += 1;
}

void Robot::step(std::uint64_t now, Eye& eye) {
  know(now);
  watch(now, eye);
  look(now, eye);
  if (mind_.next_wake() <= now) mind_.tick(now);
  while (const auto envelope = mind_.next_envelope()) radio_.say(*envelope);
}

/// Tells the mind who is there, when that has changed.
void Robot::know(std::uint64_t now) {
  auto alive = radio_.alive(now);
  if (alive != alive_) {
    mind_.set_alive(now, alive);
    alive_ = std::move(alive);
  }
  auto neighbours = radio_.neighbours(now);
  if (neighbours != neighbours_) {
    mind_.set_neighbours(now, neighbours);
    neighbours_ = std::move(neighbours);
  }
}

/// Opens a round a moment after a hand comes to rest. Who hears of one before takes part in that instead.
void Robot::watch(std::uint64_t now, Eye& eye) {
  const bool shown = eye.hand_is_shown(now);
  if (shown && !shown_) opens_at_ = now + Chance(config_.seed ^ now, config_.id).below(NOTICE);
  if (!shown) opens_at_.reset();
  shown_ = shown;
  if (opens_at_ && *opens_at_ <= now) {
    opens_at_.reset();
    if (!mind_.is_open()) mind_.open(now);
  }
}

void Robot::look(std::uint64_t now, Eye& eye) {
  if (now < next_frame_) return;
  next_frame_ += config_.frame_ns;
  if (!mind_.is_open()) return;
  const std::optional<Eye::Look> seen = eye.look(now);
  if (seen) mind_.observe(now, seen->features, seen->quality);
}

std::optional<Held> Robot::held() {
  const std::string decision = mind_.decision();
  if (decision.empty()) return std::nullopt;
  Held held{json_field(decision, "round"), std::nullopt, json_field(decision, "label")};
  const std::string gesture = json_field(decision, "class");
  if (!gesture.empty() && gesture != "null") held.gesture = std::stoi(gesture);
  return held;
}

std::string json_field(const std::string& object, const std::string& key) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t at = 0; at < object.size(); ++at) {
    const char c = object[at];
    if (quoted) {
      if (c == '\\') ++at;
      quoted = c != '"';
      continue;
    }
    if (c == '{' || c == '[') ++depth;
    if (c == '}' || c == ']') --depth;
    if (c != '"') continue;
    const std::string name = "\"" + key + "\":";
    if (depth != 1 || object.compare(at, name.size(), name) != 0) {
      quoted = true;
      continue;
    }
    const std::size_t begin = at + name.size();
    // To the comma or brace that is not within the value.
    int within = 0;
    bool text = false;
    for (std::size_t end = begin; end < object.size(); ++end) {
      const char v = object[end];
      if (text) {
        if (v == '\\') ++end;
        text = v != '"';
        continue;
      }
      if (v == '"') text = true;
      if (within == 0 && (v == ',' || v == '}')) return object.substr(begin, end - begin);
      if (v == '{' || v == '[') ++within;
      if (v == '}' || v == ']') --within;
    }
    return {};
  }
  return {};
}

}  // namespace gestalt
