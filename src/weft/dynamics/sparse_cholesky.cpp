#include "weft/dynamics/sparse_cholesky.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <numeric>

namespace weft {

// Multifrontal: vertices are ordered by nested dissection of the fabric, cut in half across its
// longer side again and again; a cut's vertices (and those of each small piece that is left) form
// one dense block of columns. A block's columns and the rows below them are gathered in a dense
// front, which is factorized with Eigen's dense kernels; what remains of it, the update, is added
// to the front of the parent.
namespace {

constexpr int kLeafSize = 10;

using DenseMap = Eigen::Map<MatX, 0, Eigen::OuterStride<>>;
using ConstDenseMap = Eigen::Map<const MatX, 0, Eigen::OuterStride<>>;

struct Node {
  int parent = -1;
  std::vector<int> pivots;     // vertices eliminated here
  std::vector<int> rows;       // later vertices coupled to them, in the order of elimination
  int first = 0;               // rank of the first pivot in the order of elimination
  std::vector<int> row_ranks;  // ranks of `rows`
  std::vector<int> children;
  std::vector<int> to_parent;  // for each of `rows`: its place among the parent's pivots and rows
  std::size_t panel = 0;       // where its columns of L start in the storage
  int entries_begin = 0, entries_end = 0;  // of Impl::entries

  int pivot_size() const { return 3 * static_cast<int>(pivots.size()); }
  int row_size() const { return 3 * static_cast<int>(rows.size()); }
  int front_size() const { return pivot_size() + row_size(); }
};

/// A stored value of the matrix and the place in the front that it is added to.
struct Entry {
  int value;
  int place;
};

class Dissection {
 public:
  Dissection(const std::vector<std::vector<int>>& neighbours, const MaterialPoints& material)
      : neighbours_(neighbours), material_(material), side_(neighbours.size(), 0) {}

  /// Nodes in the order of elimination (children before parents).
  std::vector<Node> split(std::vector<int> vertices) {
    recurse(std::move(vertices));
    return std::move(nodes_);
  }

 private:
  int recurse(std::vector<int> vertices) {
    Node node;
    if (static_cast<int>(vertices.size()) <= kLeafSize) {
      node.pivots = std::move(vertices);
    } else {
      auto [left, right] = halves(std::move(vertices));
      // A vertex of the left half that touches the right one belongs to the cut.
      for (const int i : right) side_[static_cast<std::size_t>(i)] = 1;
      const auto cut = std::stable_partition(left.begin(), left.end(), [&](int i) {
        const auto& near = neighbours_[static_cast<std::size_t>(i)];
        return std::none_of(near.begin(), near.end(),
                            [&](int j) { return side_[static_cast<std::size_t>(j)] == 1; });
      });
      for (const int i : right) side_[static_cast<std::size_t>(i)] = 0;
      node.pivots.assign(cut, left.end());
      left.erase(cut, left.end());
      if (!left.empty()) node.children.push_back(recurse(std::move(left)));
      if (!right.empty()) node.children.push_back(recurse(std::move(right)));
    }
    const int self = static_cast<int>(nodes_.size());
    for (const int child : node.children) nodes_[static_cast<std::size_t>(child)].parent = self;
    nodes_.push_back(std::move(node));
    return self;
  }

  std::pair<std::vector<int>, std::vector<int>> halves(std::vector<int> vertices) const {
    Vec2 low = material_.col(vertices.front());
    Vec2 high = low;
    for (const int i : vertices) {
      low = low.cwiseMin(material_.col(i));
      high = high.cwiseMax(material_.col(i));
    }
    const int axis = high.x() - low.x() >= high.y() - low.y() ? 0 : 1;
    std::sort(vertices.begin(), vertices.end(), [&](int i, int j) {
      const double a = material_(axis, i);
      const double b = material_(axis, j);
      return a != b ? a < b : i < j;
    });
    const auto middle = vertices.begin() + static_cast<std::ptrdiff_t>(vertices.size() / 2);
    return {{vertices.begin(), middle}, {middle, vertices.end()}};
  }

  const std::vector<std::vector<int>>& neighbours_;
  const MaterialPoints& material_;
  std::vector<char> side_;
  std::vector<Node> nodes_;
};

std::vector<std::vector<int>> vertex_neighbours(const SparseMatrix& pattern,
                                                const std::vector<char>& held) {
  std::vector<std::vector<int>> neighbours(held.size());
  for (int column = 0; column < pattern.cols(); column += 3) {
    const int j = column / 3;
    for (SparseMatrix::InnerIterator entry(pattern, column); entry; ++entry) {
      const int i = static_cast<int>(entry.row()) / 3;
      if (i == j || held[static_cast<std::size_t>(i)] || held[static_cast<std::size_t>(j)])
        continue;
      neighbours[static_cast<std::size_t>(i)].push_back(j);
      neighbours[static_cast<std::size_t>(j)].push_back(i);
    }
  }
  for (auto& list : neighbours) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbours;
}

}  // namespace

struct SparseCholesky::Impl {
  std::vector<char> held;
  std::vector<Node> nodes;
  std::vector<Entry> entries;
  std::vector<double> panels;          // columns of L, node after node
  std::vector<double> front;           // of the node at hand
  std::vector<double> updates;         // a stack: of children that wait for their parent
  std::vector<std::size_t> update_at;  // of each node
  std::vector<int> order;              // vertices in the order of elimination
  mutable Points ordered;              // right-hand side and solution in that order
  mutable Points below;                // those of a node's rows

  void analyse(const SparseMatrix& pattern, const MaterialPoints& material);
  void find_rows(const std::vector<std::vector<int>>& neighbours);
  void place_entries(const SparseMatrix& pattern);
  bool eliminate(const Node& node, double* update);
  void forward(const Node& node) const;
  void backward(const Node& node) const;
  void add_update(const Node& child, const double* update, int front_size);
};

void SparseCholesky::Impl::analyse(const SparseMatrix& pattern, const MaterialPoints& material) {
  const auto neighbours = vertex_neighbours(pattern, held);
  std::vector<int> free;
  for (int i = 0; i < static_cast<int>(held.size()); ++i) {
    if (!held[static_cast<std::size_t>(i)]) free.push_back(i);
  }
  nodes = Dissection(neighbours, material).split(std::move(free));
  find_rows(neighbours);
  place_entries(pattern);

  std::size_t panel_size = 0;
  std::size_t front_size = 0;
  std::size_t stack = 0;
  std::size_t stack_limit = 0;
  int row_size = 0;
  update_at.resize(nodes.size());
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    Node& node = nodes[k];
    node.panel = panel_size;
    const auto n = static_cast<std::size_t>(node.front_size());
    const auto rows = static_cast<std::size_t>(node.row_size());
    panel_size += n * static_cast<std::size_t>(node.pivot_size());
    front_size = std::max(front_size, n * n);
    row_size = std::max(row_size, node.row_size());
    for (const int child : node.children) {
      const auto size = static_cast<std::size_t>(nodes[static_cast<std::size_t>(child)].row_size());
      stack -= size * size;
    }
    update_at[k] = stack;
    stack += rows * rows;
    stack_limit = std::max(stack_limit, stack);
  }
  panels.resize(panel_size);
  front.resize(front_size);
  updates.resize(stack_limit);
  ordered.resize(3, static_cast<Eigen::Index>(order.size()));
  below.resize(3, row_size / 3);
}

void SparseCholesky::Impl::find_rows(const std::vector<std::vector<int>>& neighbours) {
  std::vector<int> rank(held.size(), -1);
  for (Node& node : nodes) {
    node.first = static_cast<int>(order.size());
    for (const int i : node.pivots) {
      rank[static_cast<std::size_t>(i)] = static_cast<int>(order.size());
      order.push_back(i);
    }
  }
  auto rank_of = [&](int i) { return rank[static_cast<std::size_t>(i)]; };
  std::vector<int> place(held.size(), -1);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    Node& node = nodes[k];
    const int end = node.first + static_cast<int>(node.pivots.size());
    auto take = [&](int i) {
      if (rank_of(i) >= end) node.rows.push_back(i);
    };
    for (const int i : node.pivots) {
      for (const int j : neighbours[static_cast<std::size_t>(i)]) take(j);
    }
    for (const int child : node.children) {
      for (const int i : nodes[static_cast<std::size_t>(child)].rows) take(i);
    }
    std::sort(node.rows.begin(), node.rows.end(),
              [&](int i, int j) { return rank_of(i) < rank_of(j); });
    node.rows.erase(std::unique(node.rows.begin(), node.rows.end()), node.rows.end());
    for (const int i : node.rows) node.row_ranks.push_back(rank_of(i));
    int at = 0;
    for (const int i : node.pivots) place[static_cast<std::size_t>(i)] = at++;
    for (const int i : node.rows) place[static_cast<std::size_t>(i)] = at++;
    for (const int child : node.children) {
      Node& below = nodes[static_cast<std::size_t>(child)];
      for (const int i : below.rows) below.to_parent.push_back(place[static_cast<std::size_t>(i)]);
    }
  }
}

void SparseCholesky::Impl::place_entries(const SparseMatrix& pattern) {
  std::vector<int> node_of(held.size(), -1);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    for (const int i : nodes[k].pivots) node_of[static_cast<std::size_t>(i)] = static_cast<int>(k);
  }
  struct Placed {
    int node;
    Entry entry;
  };
  std::vector<Placed> placed;
  placed.reserve(static_cast<std::size_t>(pattern.nonZeros()));
  auto place_in = [](const Node& node, int vertex) {
    const auto pivot = std::find(node.pivots.begin(), node.pivots.end(), vertex);
    if (pivot != node.pivots.end()) return static_cast<int>(pivot - node.pivots.begin());
    const auto row = std::find(node.rows.begin(), node.rows.end(), vertex);
    assert(row != node.rows.end());
    return static_cast<int>(node.pivots.size()) + static_cast<int>(row - node.rows.begin());
  };
  for (int column = 0; column < pattern.cols(); ++column) {
    const int j = column / 3;
    if (held[static_cast<std::size_t>(j)]) continue;
    for (int k = pattern.outerIndexPtr()[column]; k < pattern.outerIndexPtr()[column + 1]; ++k) {
      const int row = pattern.innerIndexPtr()[k];
      const int i = row / 3;
      if (held[static_cast<std::size_t>(i)]) continue;
      const int home =
          std::min(node_of[static_cast<std::size_t>(i)], node_of[static_cast<std::size_t>(j)]);
      const Node& node = nodes[static_cast<std::size_t>(home)];
      int front_row = 3 * place_in(node, i) + row % 3;
      int front_column = 3 * place_in(node, j) + column % 3;
      if (front_row < front_column) std::swap(front_row, front_column);
      placed.push_back({home, {k, front_column * node.front_size() + front_row}});
    }
  }
  std::stable_sort(placed.begin(), placed.end(),
                   [](const Placed& a, const Placed& b) { return a.node < b.node; });
  entries.clear();
  std::size_t at = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    nodes[k].entries_begin = static_cast<int>(at);
    for (; at < placed.size() && placed[at].node == static_cast<int>(k); ++at) {
      entries.push_back(placed[at].entry);
    }
    nodes[k].entries_end = static_cast<int>(at);
  }
}

void SparseCholesky::Impl::add_update(const Node& child, const double* update, int front_size) {
  const int n = child.row_size();
  const int blocks = static_cast<int>(child.rows.size());
  for (int bj = 0; bj < blocks; ++bj) {
    const int to_column = 3 * child.to_parent[static_cast<std::size_t>(bj)];
    for (int c = 0; c < 3; ++c) {
      const double* from = update + static_cast<std::ptrdiff_t>(3 * bj + c) * n;
      double* to = front.data() + static_cast<std::ptrdiff_t>(to_column + c) * front_size;
      for (int bi = bj; bi < blocks; ++bi) {
        const int to_row = 3 * child.to_parent[static_cast<std::size_t>(bi)];
        to[to_row] += from[3 * bi];
        to[to_row + 1] += from[3 * bi + 1];
        to[to_row + 2] += from[3 * bi + 2];
      }
    }
  }
}

bool SparseCholesky::Impl::eliminate(const Node& node, double* update) {
  const int n = node.front_size();
  const int p = node.pivot_size();
  const int r = node.row_size();
  DenseMap f(front.data(), n, n, Eigen::OuterStride<>(n));
  auto pivot = f.topLeftCorner(p, p);
  Eigen::Ref<MatX> pivot_ref(pivot);
  Eigen::LLT<Eigen::Ref<MatX>> llt(pivot_ref);
  if (llt.info() != Eigen::Success) return false;
  if (!pivot.diagonal().array().isFinite().all()) return false;  // LLT lets NaN pass
  if (r > 0) {
    auto below = f.bottomLeftCorner(r, p);
    pivot.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
    f.bottomRightCorner(r, r).selfadjointView<Eigen::Lower>().rankUpdate(below, -1.0);
    DenseMap(update, r, r, Eigen::OuterStride<>(r)).triangularView<Eigen::Lower>() =
        f.bottomRightCorner(r, r);
  }
  std::copy(front.data(), front.data() + static_cast<std::ptrdiff_t>(n) * p,
            panels.data() + node.panel);
  return true;
}

void SparseCholesky::Impl::forward(const Node& node) const {
  const int p = node.pivot_size();
  const int r = node.row_size();
  const ConstDenseMap l(panels.data() + node.panel, p + r, p, Eigen::OuterStride<>(p + r));
  Eigen::Map<VecX> pivot(ordered.data() + 3 * node.first, p);
  l.topRows(p).triangularView<Eigen::Lower>().solveInPlace(pivot);
  if (r == 0) return;
  Eigen::Map<VecX> update(below.data(), r);
  update.noalias() = l.bottomRows(r) * pivot;
  for (std::size_t k = 0; k < node.row_ranks.size(); ++k) {
    ordered.col(node.row_ranks[k]) -= below.col(static_cast<Eigen::Index>(k));
  }
}

void SparseCholesky::Impl::backward(const Node& node) const {
  const int p = node.pivot_size();
  const int r = node.row_size();
  const ConstDenseMap l(panels.data() + node.panel, p + r, p, Eigen::OuterStride<>(p + r));
  Eigen::Map<VecX> pivot(ordered.data() + 3 * node.first, p);
  if (r > 0) {
    for (std::size_t k = 0; k < node.row_ranks.size(); ++k) {
      below.col(static_cast<Eigen::Index>(k)) = ordered.col(node.row_ranks[k]);
    }
    pivot.noalias() -= l.bottomRows(r).transpose() * Eigen::Map<const VecX>(below.data(), r);
  }
  l.topRows(p).transpose().triangularView<Eigen::Upper>().solveInPlace(pivot);
}

SparseCholesky::SparseCholesky(const SparseMatrix& pattern, const std::vector<char>& held,
                               const MaterialPoints& material)
    : impl_(new Impl) {
  impl_->held = held;
  impl_->analyse(pattern, material);
}
SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

bool SparseCholesky::factorize(const SparseMatrix& matrix) {
  Impl& s = *impl_;
  const double* values = matrix.valuePtr();
  for (std::size_t k = 0; k < s.nodes.size(); ++k) {
    const Node& node = s.nodes[k];
    const int n = node.front_size();
    std::fill_n(s.front.data(), static_cast<std::size_t>(n) * static_cast<std::size_t>(n), 0.0);
    for (int e = node.entries_begin; e < node.entries_end; ++e) {
      const Entry& entry = s.entries[static_cast<std::size_t>(e)];
      s.front[static_cast<std::size_t>(entry.place)] += values[entry.value];
    }
    for (const int child : node.children) {
      s.add_update(s.nodes[static_cast<std::size_t>(child)],
                   s.updates.data() + s.update_at[static_cast<std::size_t>(child)], n);
    }
    if (!s.eliminate(node, s.updates.data() + s.update_at[k])) return false;
  }
  return true;
}

void SparseCholesky::solve(Points& b) const {
  const Impl& s = *impl_;
  for (Eigen::Index i = 0; i < b.cols(); ++i) {
    if (s.held[static_cast<std::size_t>(i)]) b.col(i).setZero();
  }
  for (std::size_t k = 0; k < s.order.size(); ++k) {
    s.ordered.col(static_cast<Eigen::Index>(k)) = b.col(s.order[k]);
  }
  for (const Node& node : s.nodes) s.forward(node);
  for (auto node = s.nodes.rbegin(); node != s.nodes.rend(); ++node) s.backward(*node);
  for (std::size_t k = 0; k < s.order.size(); ++k) {
    b.col(s.order[k]) = s.ordered.col(static_cast<Eigen::Index>(k));
  }
}

}  // namespace weft
