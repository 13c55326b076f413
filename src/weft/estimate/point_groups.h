#pragma once
#include <vector>

#include "weft/base/types.h"
#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// The measured points of a frame in 8 x 8 fields of the fabric. What moves whole clips moves the
/// points of a field alike, and is told from the sums over the fields as well as from all points:
/// the sums, each over the root of its number, are residuals with the points' noise.
class PointGroups {
 public:
  PointGroups() = default;  ///< no points
  /// Of the points that are not `left_out`, in their order.
  PointGroups(const MaterialPoints& material, const std::vector<char>& left_out);

  Eigen::Index points() const { return static_cast<Eigen::Index>(group_.size()); }
  Eigen::Index groups() const { return scale_.size(); }
  /// Sums over the fields: 3 groups rows of 3 points rows. Orthonormal: spread() is its transpose.
  MatX sums(const MatX& rows) const;
  MatX spread(const MatX& sums) const;

 private:
  std::vector<int> group_;  ///< of each point
  VecX scale_;              ///< of each group, 1 / sqrt(points)
};

}  // namespace weft
