#pragma once
#include <cstddef>

namespace weft {

/// Evaluations of a problem that its store knew, since this was made.
template <class Problem>
class Replays {
 public:
  explicit Replays(const Problem& problem) : problem_(problem), before_(problem.replayed()) {}
  std::size_t since() const { return problem_.replayed() - before_; }

 private:
  const Problem& problem_;
  std::size_t before_;
};

}  // namespace weft
