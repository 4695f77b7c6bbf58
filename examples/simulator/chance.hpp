// Chance that follows from a seed, the same on every machine and for every compiler: SplitMix64 (Steele, Lea, Flood 2014).
// The distributions of <random> are not: each library has its own.
#pragma once

#include <cstdint>

namespace gestalt {

class Chance {
 public:
  /// Streams of one seed have nothing to do with each other.
  explicit Chance(std::uint64_t seed, std::uint64_t stream = 0) : state_(seed + 0x632be59bd9b4e019 * (stream + 1)) {
    next();
  }

  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }

  /// From 0 to below `bound`, which is far below 2^64.
  std::uint64_t below(std::uint64_t bound) { return bound == 0 ? 0 : next() % bound; }
  /// From `low` to below `high`.
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(next() >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

}  // namespace gestalt
