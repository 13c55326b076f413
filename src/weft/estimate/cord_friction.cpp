#include "weft/estimate/cord_friction.h"

#include <algorithm>
#include <cmath>

namespace weft {
namespace {

/// Of the noise of a coordinate: root mean square of the clips' ways in a piece that is none. Two
/// positions make 2.4 of it.
constexpr double kStanding = 5;
constexpr double kTold = 2;  // of the least way: the longest one in a piece whose ways can be told

using Frames = std::vector<Clip>;

/// Clips that move together: 3 clips x frames.
MatX positions_of(const std::vector<const Frames*>& clips) {
  MatX positions(3 * static_cast<Eigen::Index>(clips.size()),
                 static_cast<Eigen::Index>(clips.front()->size()));
  for (std::size_t c = 0; c < clips.size(); ++c)
    for (Eigen::Index k = 0; k < positions.cols(); ++k)
      positions.block<3, 1>(3 * static_cast<Eigen::Index>(c), k) = (*clips[c])[at(k)].position;
  return positions;
}

/// The frame between that is farthest from an even motion, all clips together, if any of them is
/// farther from it than `least_way` in any frame; else `first`.
Eigen::Index farthest_from_even(const MatX& positions, Eigen::Index first, Eigen::Index last,
                                double least_way) {
  Eigen::Index farthest = first;
  double most = 0, most_of_one = 0;
  for (Eigen::Index k = first + 1; k < last; ++k) {
    const double part = static_cast<double>(k - first) / static_cast<double>(last - first);
    const VecX even = (1 - part) * positions.col(first) + part * positions.col(last);
    const VecX off = positions.col(k) - even;
    most_of_one =
        std::max(most_of_one, off.reshaped(3, off.size() / 3).colwise().norm().maxCoeff());
    if (off.norm() > most) {
      most = off.norm();
      farthest = k;
    }
  }
  return most_of_one > least_way ? farthest : first;
}

struct Piece {
  Eigen::Index first, last;
};

/// Pieces of even motion.
std::vector<Piece> pieces_of(const MatX& positions, double least_way) {
  std::vector<Piece> open{{0, positions.cols() - 1}}, found;
  while (!open.empty()) {
    const Piece piece = open.back();
    open.pop_back();
    const Eigen::Index broken = farthest_from_even(positions, piece.first, piece.last, least_way);
    if (broken == piece.first) {
      found.push_back(piece);
      continue;
    }
    open.insert(open.end(), {{piece.first, broken}, {broken, piece.last}});
  }
  return found;
}

enum class Components { all, seen };  ///< seen: those in the clip's axes longer than the least way

/// Of the motion into each frame: unit vectors, zero for a standstill and for the first frame.
Points ways_into(const Frames& clip, const std::vector<Piece>& pieces, double least_way,
                 Components components) {
  Points ways = Points::Zero(3, static_cast<Eigen::Index>(clip.size()));
  for (const auto& [first, last] : pieces) {
    Vec3 way = clip[at(last)].position - clip[at(first)].position;
    if (way.norm() <= least_way) continue;
    if (components == Components::seen) {
      const Eigen::Quaterniond& axes = clip[at((first + last) / 2)].rotation;
      const Vec3 local = axes.conjugate() * way;
      way = axes * Vec3((local.array().abs() > least_way).select(local, 0.0));
    }
    ways.middleCols(first + 1, last - first).colwise() = way.normalized();
  }
  return ways;
}

/// Out of a frame where there is no way into it.
Points through_standstills(const Points& into) {
  Points ways = into;
  for (Eigen::Index k = 1; k + 1 < ways.cols(); ++k)
    if (into.col(k).isZero(0)) ways.col(k) = into.col(k + 1);
  return ways;
}

/// What a piece of the motion of all clips is, positions known to `noise`.
enum class CordMotion { none, untold, told };
CordMotion motion_of(const MatX& positions, const Piece& piece, double least_way, double noise) {
  const VecX way = positions.col(piece.last) - positions.col(piece.first);
  const VecX lengths = way.reshaped(3, way.size() / 3).colwise().norm();
  if (lengths.squaredNorm() <= static_cast<double>(lengths.size()) * std::pow(kStanding * noise, 2))
    return CordMotion::none;
  return lengths.maxCoeff() > kTold * least_way ? CordMotion::told : CordMotion::untold;
}

std::vector<Points> ways_together(const std::vector<const Frames*>& clips, double least_way,
                                  double noise) {
  const MatX positions = positions_of(clips);
  std::vector<Piece> told, untold;
  for (const Piece& piece : pieces_of(positions, least_way)) {
    const CordMotion motion = motion_of(positions, piece, least_way, noise);
    if (motion == CordMotion::told) told.push_back(piece);
    if (motion == CordMotion::untold) untold.push_back(piece);
  }
  std::vector<Points> result;
  for (const Frames* clip : clips) {
    Points ways = through_standstills(ways_into(*clip, told, least_way, Components::seen));
    for (const auto& [first, last] : untold) ways.middleCols(first + 1, last - first).setZero();
    result.push_back(std::move(ways));
  }
  return result;
}

}  // namespace

Points ways_of_clip(const std::vector<Clip>& frames, double least_way) {
  if (frames.empty()) return Points(3, 0);
  const std::vector<Piece> pieces = pieces_of(positions_of({&frames}), least_way);
  return through_standstills(ways_into(frames, pieces, least_way, Components::all));
}

std::vector<Points> ways_of_clips(const MechanicalCapture& capture, double least_way) {
  std::vector<Points> ways;
  std::vector<const Frames*> held;
  for (const MechanicalFixture& fixture : capture.fixtures) {
    ways.push_back(Points::Zero(3, capture.frame_count));
    if (!fixture.loaded()) held.push_back(&fixture.frames);
  }
  std::vector<Points> found;
  if (capture.clip_noise > 0)
    found = ways_together(held, least_way, capture.clip_noise);
  else
    for (const Frames* clip : held) found.push_back(ways_of_clip(*clip, least_way));
  for (std::size_t c = 0, k = 0; c < ways.size(); ++c)
    if (!capture.fixtures[c].loaded()) ways[c] = std::move(found[k++]);
  return ways;
}

void add_cord_friction(const MechanicalTrial& trial, double friction, double least_way,
                       std::vector<MechanicalFrame>& frames) {
  const std::vector<Points> ways = ways_of_clips(trial.capture, least_way);
  for (std::size_t c = 0; c < ways.size(); ++c)
    for (MechanicalFrame& frame : frames)
      frame.forces.col(static_cast<Eigen::Index>(c)) += friction * ways[c].col(frame.frame);
}

}  // namespace weft
