#pragma once
/// Poses of rigid clips: small moves of them, differences between them, and what they do to the
/// vertices that clips hold. A move has six numbers: a shift (m) and a rotation vector about the
/// clip's position in world axes (rad).
#include <vector>

#include "weft/dynamics/clips.h"

namespace weft {

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

/// Half of the longer side of what a clip holds, m: what turns are weighed by against shifts.
double half_length(const Clip& clip);

/// `clip` after a move: position + shift, exp([turn]) rotation.
Clip moved_clip(const Clip& clip, const Vec6& move);
/// The move from `from` to `to`: moved_clip(from, pose_difference(to, from)) is `to`. The turn is
/// at most half of a full one.
Vec6 pose_difference(const Clip& to, const Clip& from);
/// Derivative of pose_difference(to, from) by a move of `to` (6 x 6): identity for the shift, and
/// for the turn p, of length t,
///
///     I - [p] / 2 + (1 / t^2 - 1 / (2 t tan(t / 2))) [p]^2.
Mat6 pose_difference_derivative(const Vec6& difference);

/// `clip` where the vertices that it holds, those of `clip_of` equal to `index`, are in `x`: the
/// rigid motion that fits them best. They must not lie on one line.
Clip clip_of_shape(const Clip& clip, const TriangleMesh& mesh, const std::vector<int>& clip_of,
                   int index, const Points& x);

namespace detail {

/// Of each vertex, whether a clip holds it.
std::vector<char> flags_of_held(const std::vector<int>& clip_of);
/// Puts the vertices in clips where these have them.
void place_held(const std::vector<Clip>& clips, const std::vector<int>& clip_of,
                const TriangleMesh& mesh, Points& x);
/// Forces and torques of an equilibrium from the gradient at result.x.
void sum_reactions(const Points& gradient, const std::vector<int>& clip_of,
                   const std::vector<Clip>& clips, ClipEquilibrium& result);
/// The sum over each clip's vertices: 3 clips x columns, of 3 vertices x columns.
MatX sum_over_clips(const MatX& of_vertices, const std::vector<int>& clip_of, std::size_t clips);
/// Moves of the vertices by the moves of the clips that hold them: 3 vertices x 6 clips.
MatX moves_by_poses(const Points& x, const std::vector<int>& clip_of,
                    const std::vector<Clip>& clips);

}  // namespace detail
}  // namespace weft
