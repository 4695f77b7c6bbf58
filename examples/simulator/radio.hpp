// Envelopes over a radio of small packets that only neighbours hear, such as range and bearing: cut, joined again, lost.
//
// Nothing here knows what an envelope says. A packet is one of
//   beacon  0 · from u16 · (robot u16, beat u16) …             who is alive, as far as the sender knows; its own beat first
//   part    1 · from u16 · to u16 · number u8 · index u8 · count u8 · bytes
// with numbers in little-endian order. `to` 0xffff is everybody. What is lost is not asked for again: minds repair what they lack.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "mind.hpp"

namespace gestalt {

class Radio {
 public:
  /// What became of packets and envelopes.
  struct Counters {
    std::uint64_t packets = 0;     ///< sent
    std::uint64_t envelopes = 0;   ///< joined again, whether or not they were for this robot
    std::uint64_t broken = 0;      ///< envelopes of which a part was lost
    std::uint64_t garbage = 0;     ///< packets that are none of ours
    std::uint64_t overflowed = 0;  ///< envelopes that were too long, or waited behind too many others
  };

  /// Robots are numbered from 1 to 65534; a packet has at most so many bytes, at least 16.
  Radio(std::uint32_t self, std::size_t packet_bytes);

  /// Says an envelope, as soon as there is time for it.
  void say(const Envelope& envelope);

  /// The one packet that is sent now; empty when nothing is owed.
  Bytes send(std::uint64_t now);

  /// Takes in a packet; gives the envelope that it completes, if it is for this robot.
  std::optional<Bytes> hear(std::uint64_t now, const std::uint8_t* packet, std::size_t length);

  /// The robots that were heard directly just now, in order.
  std::vector<std::uint32_t> neighbours(std::uint64_t now) const;
  /// The robots whose heart was heard to beat lately, by themselves or through others, in order; this one is not among them.
  std::vector<std::uint32_t> alive(std::uint64_t now) const;

  const Counters& counters() const { return counters_; }

 private:
  struct Peer {
    std::optional<std::uint16_t> beat;
    std::uint64_t beaten = 0;             ///< when its beat was news
    std::optional<std::uint64_t> heard;  ///< when it was heard directly
    // The envelope that is arriving.
    std::uint8_t number = 0;
    std::uint8_t count = 0;
    std::uint8_t next = 0;
    Bytes parts;
  };
  struct Waiting {
    std::uint16_t to;
    std::uint8_t number;
    std::uint8_t next;
    Bytes bytes;
  };

  Bytes beacon();
  Bytes part();
  Peer* peer(std::uint64_t now, std::uint16_t robot);
  std::optional<Bytes> join(Peer& from, const std::uint8_t* packet, std::size_t length);

  std::uint16_t self_;
  std::size_t packet_bytes_;
  std::uint16_t beat_ = 0;
  std::optional<std::uint64_t> beaconed_;
  std::uint16_t told_ = 0;  ///< up to which robot the last beacon got
  std::uint8_t numbered_ = 0;
  std::deque<Waiting> waiting_;
  std::map<std::uint16_t, Peer> peers_;
  Counters counters_;
};

}  // namespace gestalt
