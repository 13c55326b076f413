#include "weft/base/random.h"

#include <bit>
#include <cmath>

namespace weft {
namespace {

/// The output function of splitmix64: a bijection that maps 0 to 0.
std::uint64_t mix(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

}  // namespace

Rng::Rng(std::uint64_t seed, std::uint64_t stream) {
  // The stream is mixed first: consecutive streams would otherwise start splitmix64 at neighbouring
  // points of one sequence. Stream 0 is the plain seeding that other libraries use.
  std::uint64_t counter = seed ^ mix(stream);
  for (std::uint64_t& word : state_) word = mix(counter += 0x9e3779b97f4a7c15ULL);
}

std::uint64_t Rng::bits() {
  const std::uint64_t result = std::rotl(state_[0] + state_[3], 23) + state_[0];
  const std::uint64_t shifted = state_[1] << 17;
  state_[2] ^= state_[0];
  state_[3] ^= state_[1];
  state_[1] ^= state_[2];
  state_[0] ^= state_[3];
  state_[2] ^= shifted;
  state_[3] = std::rotl(state_[3], 45);
  return result;
}

double Rng::uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }

double Rng::normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  double a = 0, b = 0, square = 0;
  do {
    a = uniform(-1, 1);
    b = uniform(-1, 1);
    square = a * a + b * b;
  } while (square >= 1 || square == 0);
  const double scale = std::sqrt(-2 * std::log(square) / square);
  spare_ = scale * b;
  has_spare_ = true;
  return scale * a;
}

}  // namespace weft
