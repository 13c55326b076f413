#include "weft/estimate/point_groups.h"

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr int kFields = 8;  // along each thread

int field_of(double coordinate, double lower, double upper) {
  if (!(upper > lower)) return 0;
  return std::clamp(static_cast<int>(kFields * (coordinate - lower) / (upper - lower)), 0,
                    kFields - 1);
}

}  // namespace

PointGroups::PointGroups(const MaterialPoints& material, const std::vector<char>& left_out) {
  if (material.cols() == 0) return;
  const Vec2 lower = material.rowwise().minCoeff(), upper = material.rowwise().maxCoeff();
  std::vector<int> number(kFields * kFields, -1);
  std::vector<int> sizes;
  for (Eigen::Index i = 0; i < material.cols(); ++i) {
    if (left_out[at(i)]) continue;
    const int field = kFields * field_of(material(1, i), lower[1], upper[1]) +
                      field_of(material(0, i), lower[0], upper[0]);
    int& group = number[at(field)];
    if (group < 0) {
      group = static_cast<int>(sizes.size());
      sizes.push_back(0);
    }
    group_.push_back(group);
    ++sizes[at(group)];
  }
  scale_.resize(static_cast<Eigen::Index>(sizes.size()));
  for (std::size_t g = 0; g < sizes.size(); ++g)
    scale_[static_cast<Eigen::Index>(g)] = 1 / std::sqrt(static_cast<double>(sizes[g]));
}

MatX PointGroups::sums(const MatX& rows) const {
  MatX result = MatX::Zero(3 * groups(), rows.cols());
  for (Eigen::Index i = 0; i < points(); ++i) {
    const Eigen::Index g = group_[at(i)];
    result.middleRows(3 * g, 3) += scale_[g] * rows.middleRows(3 * i, 3);
  }
  return result;
}

MatX PointGroups::spread(const MatX& sums) const {
  MatX result(3 * points(), sums.cols());
  for (Eigen::Index i = 0; i < points(); ++i) {
    const Eigen::Index g = group_[at(i)];
    result.middleRows(3 * i, 3) = scale_[g] * sums.middleRows(3 * g, 3);
  }
  return result;
}

}  // namespace weft
