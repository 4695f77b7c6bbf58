#include "radio.hpp"

#include <algorithm>
#include <string>

namespace gestalt {

namespace {

constexpr std::uint64_t MS = 1'000'000;
/// A robot says that it lives so often …
constexpr std::uint64_t BEACON = 200 * MS;
/// … is a neighbour for so long after it was heard, through the loss of a few packets …
constexpr std::uint64_t NEAR = 1'000 * MS;
/// … and alive for so long after news of it, which may come through many robots.
constexpr std::uint64_t ALIVE = 5'000 * MS;

constexpr std::uint16_t ALL = 0xffff;
constexpr std::size_t PART_HEADER = 8;
constexpr std::size_t BEACON_HEADER = 3;
/// Bounds on what strangers can make this robot remember, and on how old what it says may become.
constexpr std::size_t MOST_PEERS = 256;
constexpr std::size_t MOST_WAITING = 64;

enum Kind : std::uint8_t { Beacon = 0, Part = 1 };

void put(Bytes& bytes, std::uint16_t number) {
  bytes.push_back(static_cast<std::uint8_t>(number & 0xff));
  bytes.push_back(static_cast<std::uint8_t>(number >> 8));
}

std::uint16_t get(const std::uint8_t* at) { return static_cast<std::uint16_t>(at[0] | at[1] << 8); }

/// Whether a count that runs round has gone on.
bool later(std::uint16_t count, std::uint16_t than) {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(count - than)) > 0;
}

}  // namespace

Radio::Radio(std::uint32_t self, std::size_t packet_bytes)
    : self_(static_cast<std::uint16_t>(self)), packet_bytes_(packet_bytes) {
  if (self == 0 || self >= ALL) {
    throw std::invalid_argument("robot " + std::to_string(self) + ": number robots from 1 to 65534");
  }
  if (packet_bytes < 2 * PART_HEADER) {
    throw std::invalid_argument("packets of " + std::to_string(packet_bytes) + " bytes: they need at least 16");
  }
}

void Radio::say(const Envelope& envelope) {
  const std::size_t room = packet_bytes_ - PART_HEADER;
  if (envelope.bytes.empty() || (envelope.bytes.size() + room - 1) / room > 0xff) {
    counters_.overflowed += 1;
    return;
  }
  if (waiting_.size() == MOST_WAITING) {
    // The oldest that is not on its way yet: what a vote says, a later one says better.
    waiting_.erase(waiting_.begin() + (waiting_.front().next > 0 ? 1 : 0));
    counters_.overflowed += 1;
  }
  const auto to = envelope.to == GESTALT_TO_ALL ? ALL : static_cast<std::uint16_t>(envelope.to);
  waiting_.push_back({to, numbered_++, 0, envelope.bytes});
}

Bytes Radio::send(std::uint64_t now) {
  const bool owed = !beaconed_ || now - *beaconed_ >= BEACON;
  if (!owed && waiting_.empty()) return {};
  counters_.packets += 1;
  if (!owed) return part();
  beaconed_ = now;
  return beacon();
}

Bytes Radio::beacon() {
  Bytes packet{Beacon};
  put(packet, self_);
  put(packet, self_);
  put(packet, ++beat_);
  // As many of the others as there is room for; the next beacon goes on where this one ends.
  auto next = peers_.upper_bound(told_);
  for (std::size_t told = 0; told < peers_.size() && packet.size() + 4 <= packet_bytes_; ++told, ++next) {
    if (next == peers_.end()) next = peers_.begin();
    put(packet, next->first);
    put(packet, next->second.beat.value_or(0));
    told_ = next->first;
  }
  return packet;
}

Bytes Radio::part() {
  Waiting& first = waiting_.front();
  const std::size_t room = packet_bytes_ - PART_HEADER;
  const std::size_t count = (first.bytes.size() + room - 1) / room;
  Bytes packet{Part};
  put(packet, self_);
  put(packet, first.to);
  packet.push_back(first.number);
  packet.push_back(first.next);
  packet.push_back(static_cast<std::uint8_t>(count));
  const std::size_t from = first.next * room;
  const std::size_t length = std::min(room, first.bytes.size() - from);
  const auto begin = first.bytes.begin() + static_cast<std::ptrdiff_t>(from);
  packet.insert(packet.end(), begin, begin + static_cast<std::ptrdiff_t>(length));
  first.next += 1;
  if (first.next == count) waiting_.pop_front();
  return packet;
}

std::optional<Bytes> Radio::hear(std::uint64_t now, const std::uint8_t* packet, std::size_t length) {
  if (length < BEACON_HEADER || packet[0] > Part || length > packet_bytes_) {
    counters_.garbage += 1;
    return std::nullopt;
  }
  const std::uint16_t from = get(packet + 1);
  Peer* sender = peer(now, from);
  if (!sender) return std::nullopt;
  sender->heard = now;
  if (packet[0] == Part) return join(*sender, packet, length);
  for (std::size_t at = BEACON_HEADER; at + 4 <= length; at += 4) {
    Peer* told = peer(now, get(packet + at));
    const std::uint16_t beat = get(packet + at + 2);
    if (told && (!told->beat || later(beat, *told->beat))) {
      told->beat = beat;
      told->beaten = now;
    }
  }
  return std::nullopt;
}

/// What is known of a robot; null for this one, for what is no robot, and for more robots than are kept.
Radio::Peer* Radio::peer(std::uint64_t now, std::uint16_t robot) {
  if (robot == self_ || robot == 0 || robot == ALL) return nullptr;
  const auto known = peers_.find(robot);
  if (known != peers_.end()) return &known->second;
  if (peers_.size() >= MOST_PEERS) return nullptr;
  Peer peer;
  peer.beaten = now;
  return &peers_.emplace(robot, std::move(peer)).first->second;
}

std::optional<Bytes> Radio::join(Peer& from, const std::uint8_t* packet, std::size_t length) {
  if (length <= PART_HEADER) {
    counters_.garbage += 1;
    return std::nullopt;
  }
  const std::uint16_t to = get(packet + 3);
  const std::uint8_t number = packet[5], index = packet[6], count = packet[7];
  if (index == 0) {
    // A packet is never overtaken by another of its sender: what has not come by now will not.
    if (from.next > 0) counters_.broken += 1;
    from.number = number;
    from.count = count;
    from.next = 0;
    from.parts.clear();
  } else if (from.next == 0) {
    // Its beginning was lost, and it was counted then or is counted by its first part.
    return std::nullopt;
  }
  if (number != from.number || count != from.count || index != from.next || index >= count) {
    counters_.broken += 1;
    from.next = 0;
    return std::nullopt;
  }
  from.parts.insert(from.parts.end(), packet + PART_HEADER, packet + length);
  from.next += 1;
  if (from.next < count) return std::nullopt;
  from.next = 0;
  counters_.envelopes += 1;
  if (to != ALL && to != self_) return std::nullopt;
  return std::move(from.parts);
}

std::vector<std::uint32_t> Radio::neighbours(std::uint64_t now) const {
  std::vector<std::uint32_t> near;
  for (const auto& [robot, peer] : peers_) {
    if (peer.heard && now - *peer.heard < NEAR) near.push_back(robot);
  }
  return near;
}

std::vector<std::uint32_t> Radio::alive(std::uint64_t now) const {
  std::vector<std::uint32_t> alive;
  for (const auto& [robot, peer] : peers_) {
    if (now - peer.beaten < ALIVE) alive.push_back(robot);
  }
  return alive;
}

}  // namespace gestalt
