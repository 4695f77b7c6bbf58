// The mind of a robot as a C++ class: gestalt.h with a destructor, exceptions and vectors.
#pragma once

#include <gestalt.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace gestalt {

using Bytes = std::vector<std::uint8_t>;

/// What the mind refused, in its own words.
class MindError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What a mind wants said to its neighbours.
struct Envelope {
  /// For one neighbour, or GESTALT_TO_ALL.
  std::uint32_t to;
  Bytes bytes;
};

class Mind {
 public:
  explicit Mind(const std::string& settings) {
    GestaltMind* mind = nullptr;
    check(gestalt_mind_new(settings.c_str(), &mind));
    mind_.reset(mind);
  }

  void load_model(std::uint64_t now, const std::string& path) {
    check(gestalt_mind_load_model(mind_.get(), now, path.c_str()));
  }

  void observe(std::uint64_t now, const std::vector<float>& features, float quality) {
    check(gestalt_mind_observe(mind_.get(), now, features.data(), features.size(), quality));
  }

  /// Whether these bytes were an envelope. What is none is the radio's fault, not the program's: it is counted, and life goes on.
  bool received(std::uint64_t now, const Bytes& envelope) {
    const GestaltStatus status =
        gestalt_mind_received(mind_.get(), now, nullptr, envelope.data(), envelope.size());
    if (status == GESTALT_STATUS_MESSAGE) return false;
    check(status);
    return true;
  }

  void open(std::uint64_t now) { check(gestalt_mind_open(mind_.get(), now)); }
  bool is_open() { return check(gestalt_mind_is_open(mind_.get())) == GESTALT_STATUS_OK; }
  void tick(std::uint64_t now) { check(gestalt_mind_tick(mind_.get(), now)); }
  std::uint64_t next_wake() { return gestalt_mind_next_wake(mind_.get()); }

  void set_blind(std::uint64_t now, bool blind) { check(gestalt_mind_set_blind(mind_.get(), now, blind)); }
  void set_alive(std::uint64_t now, const std::vector<std::uint32_t>& robots) {
    check(gestalt_mind_set_alive(mind_.get(), now, robots.data(), robots.size()));
  }
  void set_neighbours(std::uint64_t now, const std::vector<std::uint32_t>& robots) {
    check(gestalt_mind_set_neighbours(mind_.get(), now, robots.data(), robots.size()));
  }

  /// The next envelope to say. What a mind says as JSON is for clients, who are not on this radio: it is passed over.
  std::optional<Envelope> next_envelope() {
    for (;;) {
      GestaltMessage message{};
      message.key = key_.data();
      message.key_capacity = key_.size();
      message.payload = payload_.data();
      message.payload_capacity = payload_.size();
      const GestaltStatus status = check(gestalt_mind_next_message(mind_.get(), &message));
      if (status == GESTALT_STATUS_NOTHING) return std::nullopt;
      if (status == GESTALT_STATUS_TOO_SMALL) {
        key_.resize(message.key_length + 1);
        payload_.resize(message.payload_length);
        continue;
      }
      if (message.json) continue;
      const auto end = payload_.begin() + static_cast<std::ptrdiff_t>(message.payload_length);
      return Envelope{message.to, Bytes(payload_.begin(), end)};
    }
  }

  /// The decision held for the newest round, as JSON; empty before the first.
  std::string decision() { return text(gestalt_mind_decision); }
  /// What the mind has to say of itself, as JSON.
  std::string status() { return text(gestalt_mind_status); }

 private:
  struct Free {
    void operator()(GestaltMind* mind) const { gestalt_mind_free(mind); }
  };

  static GestaltStatus check(GestaltStatus status) {
    if (status < 0) {
      std::string why(gestalt_last_error(nullptr, 0) + 1, '\0');
      gestalt_last_error(why.data(), why.size());
      why.pop_back();
      throw MindError(why);
    }
    return status;
  }

  std::string text(GestaltStatus (*ask)(GestaltMind*, char*, std::size_t, std::size_t*)) {
    std::string answer(4096, '\0');
    std::size_t length = 0;
    GestaltStatus status = check(ask(mind_.get(), answer.data(), answer.size(), &length));
    if (status == GESTALT_STATUS_TOO_SMALL) {
      answer.resize(length + 1);
      status = check(ask(mind_.get(), answer.data(), answer.size(), &length));
    }
    answer.resize(status == GESTALT_STATUS_OK ? length : 0);
    return answer;
  }

  std::unique_ptr<GestaltMind, Free> mind_;
  std::string key_ = std::string(128, '\0');
  Bytes payload_ = Bytes(4096);
};

}  // namespace gestalt
