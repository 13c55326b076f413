#include "weft/estimate/cord_friction.h"

#include <utility>

namespace weft {
namespace {

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

Points positions_of(const std::vector<Clip>& frames) {
  Points positions(3, static_cast<Eigen::Index>(frames.size()));
  for (Eigen::Index k = 0; k < positions.cols(); ++k) positions.col(k) = frames[at(k)].position;
  return positions;
}

/// The frame between that is farthest from an even motion, if farther than `least_way`; else
/// `first`.
Eigen::Index farthest_from_even(const Points& positions, Eigen::Index first, Eigen::Index last,
                                double least_way) {
  Eigen::Index farthest = first;
  double most = least_way;
  for (Eigen::Index k = first + 1; k < last; ++k) {
    const double part = static_cast<double>(k - first) / static_cast<double>(last - first);
    const Vec3 even = (1 - part) * positions.col(first) + part * positions.col(last);
    const double off = (positions.col(k) - even).norm();
    if (off > most) {
      most = off;
      farthest = k;
    }
  }
  return farthest;
}

/// Of the motion into each frame: unit vectors, zero for a standstill and for the first frame.
Points ways_into(const Points& positions, double least_way) {
  Points ways = Points::Zero(3, positions.cols());
  std::vector<std::pair<Eigen::Index, Eigen::Index>> pieces{{0, positions.cols() - 1}};
  while (!pieces.empty()) {
    const auto [first, last] = pieces.back();
    pieces.pop_back();
    const Eigen::Index broken = farthest_from_even(positions, first, last, least_way);
    if (broken != first) {
      pieces.insert(pieces.end(), {{first, broken}, {broken, last}});
      continue;
    }
    const Vec3 way = positions.col(last) - positions.col(first);
    if (way.norm() > least_way)
      ways.middleCols(first + 1, last - first).colwise() = way.normalized();
  }
  return ways;
}

}  // namespace

Points ways_of_clip(const std::vector<Clip>& frames, double least_way) {
  if (frames.empty()) return Points(3, 0);
  const Points into = ways_into(positions_of(frames), least_way);
  Points ways = into;
  for (Eigen::Index k = 1; k + 1 < ways.cols(); ++k)
    if (into.col(k).isZero(0)) ways.col(k) = into.col(k + 1);
  return ways;
}

void add_cord_friction(const MechanicalTrial& trial, double friction, double least_way,
                       std::vector<MechanicalFrame>& frames) {
  for (std::size_t c = 0; c < trial.capture.fixtures.size(); ++c) {
    const Points ways = ways_of_clip(trial.capture.fixtures[c].frames, least_way);
    for (MechanicalFrame& frame : frames)
      frame.forces.col(static_cast<Eigen::Index>(c)) += friction * ways.col(frame.frame);
  }
}

}  // namespace weft
