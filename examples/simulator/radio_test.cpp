// The radio by itself: what is cut is joined again, and what comes from outside can neither break it nor make it grow.
#include "radio.hpp"

#include <cstdio>
#include <cstdlib>

#include "chance.hpp"

namespace {

using namespace gestalt;

void expect(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "radio: not so: %s\n", what);
  std::exit(1);
}

constexpr std::uint64_t SECOND = 1'000'000'000;

Bytes some(Chance& chance, std::size_t length) {
  Bytes bytes(length);
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(chance.next());
  return bytes;
}

void every_length_is_joined_again_by_whom_it_is_for() {
  Chance chance(1);
  for (const std::size_t packet : {16, 32, 64, 100}) {
    for (std::size_t length = 1; length <= 255 * (packet - 8); length += 1 + chance.below(97)) {
      Radio sender(1, packet), receiver(2, packet), other(3, packet);
      const Bytes envelope = some(chance, length);
      sender.say({2, envelope});
      std::uint64_t now = 0;
      int got = 0;
      for (Bytes sent = sender.send(now); !sent.empty(); sent = sender.send(now)) {
        expect(sent.size() <= packet, "a packet is no longer than the radio's");
        const auto joined = receiver.hear(now, sent.data(), sent.size());
        if (joined) {
          expect(*joined == envelope, "what is joined is what was cut");
          ++got;
        }
        expect(!other.hear(now, sent.data(), sent.size()), "what is for another is not handed on");
        now += 1000;
      }
      expect(got == 1, "one envelope arrives once");
    }
  }
}

void a_lost_part_loses_one_envelope_and_not_the_next() {
  Chance chance(2);
  Radio sender(1, 32), receiver(2, 32);
  const Bytes first = some(chance, 90), second = some(chance, 90);
  sender.send(0);  // its beacon
  sender.say({GESTALT_TO_ALL, first});
  sender.say({GESTALT_TO_ALL, second});
  int joined = 0;
  for (int n = 0; n < 8; ++n) {
    const Bytes sent = sender.send(1);
    if (n == 2) continue;
    const auto envelope = receiver.hear(1, sent.data(), sent.size());
    if (envelope) {
      expect(*envelope == second, "the second one");
      ++joined;
    }
  }
  expect(joined == 1 && receiver.counters().broken >= 1, "the first one counts as broken");
}

void whoever_is_heard_is_near_and_whoever_is_told_of_is_alive() {
  Radio one(1, 64), two(2, 64), three(3, 64);
  for (std::uint64_t now = 0; now < 2 * SECOND; now += SECOND / 5) {
    const Bytes a = one.send(now), b = two.send(now);
    two.hear(now, a.data(), a.size());
    three.hear(now, b.data(), b.size());
  }
  const std::uint64_t now = 2 * SECOND;
  expect(three.neighbours(now) == std::vector<std::uint32_t>{2}, "a robot two hops away is no neighbour");
  expect((three.alive(now) == std::vector<std::uint32_t>{1, 2}), "it is alive all the same");
  expect(three.neighbours(now + 2 * SECOND).empty(), "who falls silent is no neighbour any more");
  expect(three.alive(now + 9 * SECOND).empty(), "nor alive, after a while");
}

void what_waits_is_bounded() {
  Chance chance(3);
  Radio radio(1, 64);
  for (int n = 0; n < 10'000; ++n) radio.say({GESTALT_TO_ALL, some(chance, 400)});
  radio.say({GESTALT_TO_ALL, some(chance, 255 * 56 + 1)});
  radio.say({GESTALT_TO_ALL, {}});
  expect(radio.counters().overflowed == 10'000 - 64 + 2, "the oldest give way, and what is too long is refused");
}

void garbage_is_taken_for_none() {
  Chance chance(4);
  Radio radio(1, 64);
  std::uint64_t now = 0;
  for (int n = 0; n < 300'000; ++n) {
    Bytes packet = some(chance, chance.below(80));
    // Mostly what begins as packets do.
    if (!packet.empty() && chance.below(4) > 0) packet[0] &= 1;
    if (packet.size() > 7 && chance.below(2) > 0) packet[7] = static_cast<std::uint8_t>(packet[6] + 1);
    radio.hear(now, packet.data(), packet.size());
    now += 1'000'000;
  }
  expect(radio.alive(now).size() <= 256 && radio.neighbours(now).size() <= 256, "strangers fill a bounded table");
  expect(radio.counters().garbage > 0, "what is no packet is counted");
}

void numbers_that_cannot_be_are_refused() {
  for (const auto& [robot, packet] : {std::pair<std::uint32_t, std::size_t>{0, 64}, {65'535, 64}, {1, 15}}) {
    bool refused = false;
    try {
      Radio(robot, packet);
    } catch (const std::invalid_argument&) {
      refused = true;
    }
    expect(refused, "a robot or a packet that cannot be");
  }
}

}  // namespace

int main() {
  every_length_is_joined_again_by_whom_it_is_for();
  a_lost_part_loses_one_envelope_and_not_the_next();
  whoever_is_heard_is_near_and_whoever_is_told_of_is_alive();
  what_waits_is_bounded();
  garbage_is_taken_for_none();
  numbers_that_cannot_be_are_refused();
  std::puts("radio: all as it should be");
  return 0;
}
