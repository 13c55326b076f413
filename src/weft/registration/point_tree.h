#pragma once
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// A k-d tree over points (Bentley 1975), for the few queries that registration asks. Keeps a copy
/// of the points. Results do not depend on anything but the points and their order.
class PointTree {
 public:
  /// `points`: 3 x n, m, finite.
  explicit PointTree(const Points& points);

  struct Neighbour {
    int index = -1;      ///< column of the points; -1: none within reach
    double squared = 0;  ///< m^2
  };
  /// The nearest point closer than `reach`, m.
  Neighbour nearest(const Vec3& query, double reach = kInfinity) const;
  /// The `count` nearest points, nearest first (fewer where the tree has fewer), into `found`.
  void nearest(const Vec3& query, int count, std::vector<Neighbour>& found) const;
  /// All points closer than `radius`, m, in no particular order, into `found`.
  void within(const Vec3& query, double radius, std::vector<Neighbour>& found) const;

  int size() const { return static_cast<int>(points_.cols()); }

 private:
  struct Node {
    int begin = 0, end = 0;  ///< of order_
    int axis = -1;           ///< -1: a leaf
    double split = 0;
    int left = -1, right = -1;
  };
  int build(int begin, int end);
  template <class Visit>
  void search(int node, const Vec3& query, double& reach_squared, const Visit& visit) const;

  Points points_;  ///< in the order of the leaves
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace weft
