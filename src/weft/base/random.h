#pragma once
#include <cstdint>

namespace weft {

/// xoshiro256++ (Blackman and Vigna 2019), seeded by splitmix64. The same numbers on every platform
/// and compiler, which std::normal_distribution does not promise. `stream` separates independent
/// sequences of one seed (one a task), so that results do not depend on the order of execution.
class Rng {
 public:
  explicit Rng(std::uint64_t seed, std::uint64_t stream = 0);
  std::uint64_t bits();
  /// Uniform in [0, 1).
  double uniform();
  double uniform(double lower, double upper) { return lower + (upper - lower) * uniform(); }
  /// Standard normal (polar method).
  double normal();

 private:
  std::uint64_t state_[4];
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace weft
