#include "weft/registration/point_tree.h"

#include <algorithm>
#include <numeric>

namespace weft {
namespace {

constexpr int kLeafSize = 8;

bool nearer(const PointTree::Neighbour& a, const PointTree::Neighbour& b) {
  return a.squared != b.squared ? a.squared < b.squared : a.index < b.index;
}

}  // namespace

PointTree::PointTree(const Points& points) : points_(points) {
  order_.resize(static_cast<std::size_t>(points.cols()));
  std::iota(order_.begin(), order_.end(), 0);
  if (!order_.empty()) build(0, static_cast<int>(order_.size()));
  Points sorted(3, points.cols());
  for (std::size_t i = 0; i < order_.size(); ++i) {
    sorted.col(static_cast<Eigen::Index>(i)) = points.col(order_[i]);
  }
  points_ = std::move(sorted);
}

int PointTree::build(int begin, int end) {
  const int self = static_cast<int>(nodes_.size());
  nodes_.push_back({begin, end, -1, 0, -1, -1});
  if (end - begin <= kLeafSize) return self;
  Vec3 lower = points_.col(order_[static_cast<std::size_t>(begin)]), upper = lower;
  for (int i = begin; i < end; ++i) {
    const Vec3 p = points_.col(order_[static_cast<std::size_t>(i)]);
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
  Eigen::Index axis = 0;
  if (!((upper - lower).maxCoeff(&axis) > 0)) return self;
  const int middle = (begin + end) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](int a, int b) {
                     const double pa = points_(axis, a), pb = points_(axis, b);
                     return pa != pb ? pa < pb : a < b;
                   });
  const double split = points_(axis, order_[static_cast<std::size_t>(middle)]);
  const int left = build(begin, middle);
  const int right = build(middle, end);
  Node& node = nodes_[static_cast<std::size_t>(self)];
  node.axis = static_cast<int>(axis);
  node.split = split;
  node.left = left;
  node.right = right;
  return self;
}

template <class Visit>
void PointTree::search(int at, const Vec3& query, double& reach_squared, const Visit& visit) const {
  const Node& node = nodes_[static_cast<std::size_t>(at)];
  if (node.axis < 0) {
    for (int i = node.begin; i < node.end; ++i) {
      const double squared = (points_.col(i) - query).squaredNorm();
      if (squared < reach_squared) visit({order_[static_cast<std::size_t>(i)], squared});
    }
    return;
  }
  const double side = query[node.axis] - node.split;
  search(side < 0 ? node.left : node.right, query, reach_squared, visit);
  if (side * side < reach_squared) {
    search(side < 0 ? node.right : node.left, query, reach_squared, visit);
  }
}

PointTree::Neighbour PointTree::nearest(const Vec3& query, double reach) const {
  Neighbour best;
  double reach_squared = reach * reach;
  if (nodes_.empty()) return best;
  search(0, query, reach_squared, [&](const Neighbour& found) {
    best = found;
    reach_squared = found.squared;
  });
  return best;
}

void PointTree::nearest(const Vec3& query, int count, std::vector<Neighbour>& found) const {
  found.clear();
  if (nodes_.empty() || count < 1) return;
  double reach_squared = kInfinity;
  search(0, query, reach_squared, [&](const Neighbour& next) {
    const auto full = static_cast<int>(found.size()) == count;
    if (full) {
      std::pop_heap(found.begin(), found.end(), nearer);
      found.back() = next;
    } else {
      found.push_back(next);
    }
    std::push_heap(found.begin(), found.end(), nearer);
    if (static_cast<int>(found.size()) == count) reach_squared = found.front().squared;
  });
  std::sort_heap(found.begin(), found.end(), nearer);
}

void PointTree::within(const Vec3& query, double radius, std::vector<Neighbour>& found) const {
  found.clear();
  double reach_squared = radius * radius;
  if (nodes_.empty()) return;
  search(0, query, reach_squared, [&](const Neighbour& next) { found.push_back(next); });
}

}  // namespace weft
