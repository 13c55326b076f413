#include "weft/dynamics/sparse_cholesky.h"

#include <algorithm>
#include <cassert>

#include "weft/dynamics/dense_kernels.h"

namespace weft {

// Multifrontal: vertices are ordered by nested dissection of the fabric, cut in half across its
// longer side again and again; a cut's vertices (and those of each small piece that is left) form
// one node, a dense block of columns. The node's panel holds these columns of the matrix, of what
// its children left, and then of the factor; what it leaves for the rows below, its update, is
// added to the panel and the update of its parent. A parent and its children use different stacks
// for their updates.
namespace {

constexpr int kLeafSize = 10;

struct Node {
  int parent = -1;
  std::vector<int> pivots;     // vertices eliminated here
  int first = 0;               // rank of the first pivot in the order of elimination
  std::vector<int> row_ranks;  // ranks of the later vertices that are coupled to them, rising
  std::vector<int> children;
  struct Run {
    int row, place, count;
  };
  std::vector<Run> runs;                  // where its rows stand among the parent's pivots and rows
  int depth = 0;                          // of the node in the tree
  std::size_t panel = 0, panel_ld = 0;    // its columns in the storage
  std::size_t update = 0, update_ld = 0;  // in the stack of its depth
  std::size_t entries_begin = 0, entries_end = 0;  // of Impl::entries

  int pivot_size() const { return 3 * static_cast<int>(pivots.size()); }
  int row_size() const { return 3 * static_cast<int>(row_ranks.size()); }
  int front_size() const { return pivot_size() + row_size(); }
};

/// Up to three values that follow each other in a column of the matrix, and where in the panel they
/// are added: one under the other, or side by side where the matrix has the transposed block.
struct Entry {
  int value;
  int place;
  int count;
  int stride;
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

template <class Scalar>
struct SparseCholesky<Scalar>::Structure {
  static constexpr int kSpare = dense::kTileRows<Scalar> - 1;

  std::vector<char> held;
  std::vector<Node> nodes;
  std::vector<int> order;  // vertices in the order of elimination
  std::vector<Entry> entries;
  std::size_t panel_size = 0;           // of all
  std::size_t update_size[2] = {0, 0};  // of the stacks
  std::size_t largest = 0;              // front of a node

  Structure(const SparseMatrix& pattern, std::vector<char> held_vertices,
            const MaterialPoints& material);
  void find_rows(const std::vector<std::vector<int>>& neighbours);
  void place_nodes();
  void place_entries(const SparseMatrix& pattern);
};

template <class Scalar>
struct SparseCholesky<Scalar>::Impl {
  static constexpr int kSpare = Structure::kSpare;

  std::shared_ptr<const Structure> structure;
  const std::vector<Node>& nodes;
  std::vector<Scalar> panels;      // node after node
  std::vector<Scalar> updates[2];  // stacks, of nodes at even and odd depth
  std::vector<Scalar> inverse_diagonal;
  mutable std::vector<Scalar> ordered;  // right-hand side and solution in the order of elimination
  mutable std::vector<Scalar> work;     // those of one node
  mutable std::vector<Scalar> ordered_rows, work_rows;  // the same for kDirections of them

  explicit Impl(std::shared_ptr<const Structure> shared);
  void gather(const Node& node, const double* values);
  void add_update(const Node& child, const Node& node, int begin, int end);
  bool eliminate(const Node& node);
  void forward(const Node& node) const;
  void backward(const Node& node) const;
  void forward_rows(const Node& node) const;
  void backward_rows(const Node& node) const;

  Scalar* panel(const Node& node) { return panels.data() + node.panel; }
  const Scalar* panel(const Node& node) const { return panels.data() + node.panel; }
  Scalar* update(const Node& node) { return updates[node.depth % 2].data() + node.update; }
};

template <class Scalar>
SparseCholesky<Scalar>::Structure::Structure(const SparseMatrix& pattern,
                                             std::vector<char> held_vertices,
                                             const MaterialPoints& material)
    : held(std::move(held_vertices)) {
  const auto neighbours = vertex_neighbours(pattern, held);
  std::vector<int> free;
  for (int i = 0; i < static_cast<int>(held.size()); ++i) {
    if (!held[static_cast<std::size_t>(i)]) free.push_back(i);
  }
  nodes = Dissection(neighbours, material).split(std::move(free));
  find_rows(neighbours);
  place_nodes();
  place_entries(pattern);
}

template <class Scalar>
void SparseCholesky<Scalar>::Structure::find_rows(const std::vector<std::vector<int>>& neighbours) {
  std::vector<int> rank(held.size(), -1);
  for (Node& node : nodes) {
    node.first = static_cast<int>(order.size());
    for (const int i : node.pivots) {
      rank[static_cast<std::size_t>(i)] = static_cast<int>(order.size());
      order.push_back(i);
    }
  }
  std::vector<int> place(order.size());  // by rank, in the node at hand
  for (Node& node : nodes) {
    const int end = node.first + static_cast<int>(node.pivots.size());
    auto take = [&](int i) {
      if (i >= end) node.row_ranks.push_back(i);
    };
    for (const int i : node.pivots) {
      for (const int j : neighbours[static_cast<std::size_t>(i)]) {
        take(rank[static_cast<std::size_t>(j)]);
      }
    }
    for (const int child : node.children) {
      for (const int i : nodes[static_cast<std::size_t>(child)].row_ranks) take(i);
    }
    std::sort(node.row_ranks.begin(), node.row_ranks.end());
    node.row_ranks.erase(std::unique(node.row_ranks.begin(), node.row_ranks.end()),
                         node.row_ranks.end());
    for (int i = node.first; i < end; ++i) place[static_cast<std::size_t>(i)] = i - node.first;
    int at = end - node.first;
    for (const int i : node.row_ranks) place[static_cast<std::size_t>(i)] = at++;
    for (const int child : node.children) {
      Node& below = nodes[static_cast<std::size_t>(child)];
      for (int row = 0; row < static_cast<int>(below.row_ranks.size()); ++row) {
        const int to =
            place[static_cast<std::size_t>(below.row_ranks[static_cast<std::size_t>(row)])];
        if (!below.runs.empty() && below.runs.back().place + below.runs.back().count == to) {
          ++below.runs.back().count;
        } else {
          below.runs.push_back({row, to, 1});
        }
      }
    }
  }
  for (auto node = nodes.rbegin(); node != nodes.rend(); ++node) {
    for (const int child : node->children) {
      nodes[static_cast<std::size_t>(child)].depth = node->depth + 1;
    }
  }
}

template <class Scalar>
void SparseCholesky<Scalar>::Structure::place_nodes() {
  std::size_t used[2] = {0, 0};
  for (Node& node : nodes) {
    node.panel = panel_size;
    node.panel_ld = static_cast<std::size_t>(node.front_size() + kSpare);
    panel_size += node.panel_ld * static_cast<std::size_t>(node.pivot_size());
    for (const int child : node.children) {
      // Children are on top of their stack; the first of them is the lowest.
      used[(node.depth + 1) % 2] =
          std::min(used[(node.depth + 1) % 2], nodes[static_cast<std::size_t>(child)].update);
    }
    std::size_t& top = used[node.depth % 2];
    node.update = top;
    node.update_ld = static_cast<std::size_t>(node.row_size() + kSpare);
    top += node.update_ld * static_cast<std::size_t>(node.row_size());
    std::size_t& size = update_size[node.depth % 2];
    size = std::max(size, top);
    largest = std::max(largest, static_cast<std::size_t>(node.front_size()));
  }
}

template <class Scalar>
void SparseCholesky<Scalar>::Structure::place_entries(const SparseMatrix& pattern) {
  std::vector<int> rank(held.size(), -1);
  std::vector<int> node_of(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    rank[static_cast<std::size_t>(order[k])] = static_cast<int>(k);
  }
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    for (std::size_t i = 0; i < nodes[k].pivots.size(); ++i) {
      node_of[static_cast<std::size_t>(nodes[k].first) + i] = static_cast<int>(k);
    }
  }
  auto place_in = [](const Node& node, int vertex_rank) {
    const int pivots = static_cast<int>(node.pivots.size());
    if (vertex_rank < node.first + pivots) return vertex_rank - node.first;
    const auto row = std::lower_bound(node.row_ranks.begin(), node.row_ranks.end(), vertex_rank);
    assert(row != node.row_ranks.end() && *row == vertex_rank);
    return pivots + static_cast<int>(row - node.row_ranks.begin());
  };
  std::vector<std::vector<Entry>> of_node(nodes.size());
  for (int column = 0; column < pattern.cols(); ++column) {
    const int j = rank[static_cast<std::size_t>(column / 3)];
    if (j < 0) continue;
    const int end = pattern.outerIndexPtr()[column + 1];
    for (int k = pattern.outerIndexPtr()[column]; k < end;) {
      const int row = pattern.innerIndexPtr()[k];
      const int count = 3 - row % 3;  // to the end of the block
      const int i = rank[static_cast<std::size_t>(row / 3)];
      if (i >= 0) {
        const int home = node_of[static_cast<std::size_t>(std::min(i, j))];
        const Node& node = nodes[static_cast<std::size_t>(home)];
        const int ld = static_cast<int>(node.panel_ld);
        const int at_row = 3 * place_in(node, i) + row % 3;
        const int at_column = 3 * place_in(node, j) + column % 3;
        const bool upright = i >= j;
        of_node[static_cast<std::size_t>(home)].push_back(
            {k, upright ? at_column * ld + at_row : at_row * ld + at_column, count,
             upright ? 1 : ld});
      }
      k += count;
    }
  }
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    nodes[k].entries_begin = entries.size();
    entries.insert(entries.end(), of_node[k].begin(), of_node[k].end());
    nodes[k].entries_end = entries.size();
  }
}

template <class Scalar>
SparseCholesky<Scalar>::Impl::Impl(std::shared_ptr<const Structure> shared)
    : structure(std::move(shared)), nodes(structure->nodes) {
  panels.assign(structure->panel_size + kSpare, Scalar(0));
  for (int i : {0, 1}) updates[i].assign(structure->update_size[i] + kSpare, Scalar(0));
  inverse_diagonal.resize(3 * structure->order.size());
  ordered.resize(3 * structure->order.size());
  work.assign(structure->largest + kSpare, Scalar(0));
}

/// The node's columns of the matrix and of what its children left.
template <class Scalar>
void SparseCholesky<Scalar>::Impl::gather(const Node& node, const double* values) {
  Scalar* to = panel(node);
  std::fill_n(to, node.panel_ld * static_cast<std::size_t>(node.pivot_size()), Scalar(0));
  for (std::size_t e = node.entries_begin; e < node.entries_end; ++e) {
    const Entry& entry = structure->entries[e];
    for (int i = 0; i < entry.count; ++i) {
      to[entry.place + i * entry.stride] += static_cast<Scalar>(values[entry.value + i]);
    }
  }
  for (const int child : node.children)
    add_update(nodes[static_cast<std::size_t>(child)], node, 0, node.pivot_size());
}

/// To the columns from `begin` to `end` of the node: those of its pivots are in its panel, the
/// others in its update, which starts below the pivots.
template <class Scalar>
void SparseCholesky<Scalar>::Impl::add_update(const Node& child, const Node& node, int begin,
                                              int end) {
  const int pivots = node.pivot_size();
  for (std::size_t run = 0; run < child.runs.size(); ++run) {
    const auto [first, place, columns] = child.runs[run];
    const int last = std::min(3 * columns, end - 3 * place);
    for (int column = std::max(0, begin - 3 * place); column < last; ++column) {
      const Scalar* from =
          update(child) + static_cast<std::size_t>(3 * first + column) * child.update_ld;
      const int at = 3 * place + column;
      Scalar* to =
          at < pivots
              ? panel(node) + static_cast<std::size_t>(at) * node.panel_ld
              : update(node) + static_cast<std::size_t>(at - pivots) * node.update_ld - pivots;
      for (std::size_t below = run; below < child.runs.size(); ++below) {
        const auto& rows = child.runs[below];
        const int skip = below == run ? 3 * (column / 3) : 0;
        dense::add(from + 3 * rows.row + skip, 3 * rows.count - skip, to + 3 * rows.place + skip);
      }
    }
  }
}

/// The node's own update is written before what its children left is added to it: nothing has to
/// be zeroed first.
template <class Scalar>
bool SparseCholesky<Scalar>::Impl::eliminate(const Node& node) {
  const auto ld = static_cast<std::ptrdiff_t>(node.panel_ld);
  const int pivots = node.pivot_size();
  if (!dense::factorize_panel(panel(node), ld, node.front_size(), pivots,
                              inverse_diagonal.data() + 3 * node.first)) {
    return false;
  }
  dense::negative_square<Scalar>(panel(node) + pivots, pivots, ld, update(node),
                                 static_cast<std::ptrdiff_t>(node.update_ld), node.row_size());
  for (const int child : node.children)
    add_update(nodes[static_cast<std::size_t>(child)], node, pivots, node.front_size());
  return true;
}

template <class Scalar>
void SparseCholesky<Scalar>::Impl::forward(const Node& node) const {
  const int pivots = node.pivot_size();
  const auto rows = static_cast<std::size_t>(node.row_size());
  Scalar* pivot = ordered.data() + 3 * node.first;
  std::copy_n(pivot, pivots, work.data());
  std::fill_n(work.data() + pivots, rows + kSpare, Scalar(0));
  dense::solve_forward(panel(node), static_cast<std::ptrdiff_t>(node.panel_ld), node.front_size(),
                       pivots, inverse_diagonal.data() + 3 * node.first, work.data());
  std::copy_n(work.data(), pivots, pivot);
  const Scalar* from = work.data() + pivots;
  for (const int rank : node.row_ranks) {
    for (int k = 0; k < 3; ++k) ordered[static_cast<std::size_t>(3 * rank + k)] += *from++;
  }
}

template <class Scalar>
void SparseCholesky<Scalar>::Impl::backward(const Node& node) const {
  const int pivots = node.pivot_size();
  Scalar* pivot = ordered.data() + 3 * node.first;
  std::copy_n(pivot, pivots, work.data());
  Scalar* to = work.data() + pivots;
  for (const int rank : node.row_ranks) {
    for (int k = 0; k < 3; ++k) *to++ = ordered[static_cast<std::size_t>(3 * rank + k)];
  }
  std::fill_n(to, kSpare, Scalar(0));
  dense::solve_backward(panel(node), static_cast<std::ptrdiff_t>(node.panel_ld), node.front_size(),
                        pivots, inverse_diagonal.data() + 3 * node.first, work.data());
  std::copy_n(work.data(), pivots, pivot);
}

template <class Scalar>
SparseCholesky<Scalar>::SparseCholesky(const SparseMatrix& pattern, const std::vector<char>& held,
                                       const MaterialPoints& material)
    : impl_(new Impl(std::make_shared<const Structure>(pattern, held, material))) {}
template <class Scalar>
SparseCholesky<Scalar>::SparseCholesky(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
template <class Scalar>
SparseCholesky<Scalar>::~SparseCholesky() = default;
template <class Scalar>
SparseCholesky<Scalar>::SparseCholesky(SparseCholesky&&) noexcept = default;
template <class Scalar>
SparseCholesky<Scalar>& SparseCholesky<Scalar>::operator=(SparseCholesky&&) noexcept = default;

template <class Scalar>
SparseCholesky<Scalar> SparseCholesky<Scalar>::another() const {
  return SparseCholesky(std::make_unique<Impl>(impl_->structure));
}

template <class Scalar>
bool SparseCholesky<Scalar>::factorize(const SparseMatrix& matrix) {
  for (const Node& node : impl_->nodes) {
    impl_->gather(node, matrix.valuePtr());
    if (!impl_->eliminate(node)) return false;
  }
  return true;
}

template <class Scalar>
void SparseCholesky<Scalar>::solve(Points& b) const {
  const Impl& s = *impl_;
  const std::vector<int>& order = s.structure->order;
  Scalar* ordered = s.ordered.data();
  for (std::size_t k = 0; k < order.size(); ++k) {
    for (int i = 0; i < 3; ++i) ordered[3 * k + i] = static_cast<Scalar>(b(i, order[k]));
  }
  for (const Node& node : s.nodes) s.forward(node);
  for (auto node = s.nodes.rbegin(); node != s.nodes.rend(); ++node) s.backward(*node);
  for (Eigen::Index i = 0; i < b.cols(); ++i) {
    if (s.structure->held[static_cast<std::size_t>(i)]) b.col(i).setZero();
  }
  for (std::size_t k = 0; k < order.size(); ++k) {
    for (int i = 0; i < 3; ++i) b(i, order[k]) = ordered[3 * k + i];
  }
}

template <class Scalar>
void SparseCholesky<Scalar>::Impl::forward_rows(const Node& node) const {
  const auto pivots = static_cast<std::size_t>(node.pivot_size() * kDirections);
  const auto rows = static_cast<std::size_t>(node.row_size() * kDirections);
  Scalar* pivot = ordered_rows.data() + std::ptrdiff_t{3 * kDirections} * node.first;
  std::copy_n(pivot, pivots, work_rows.data());
  std::fill_n(work_rows.data() + pivots, rows, Scalar(0));
  dense::solve_forward_rows(panel(node), static_cast<std::ptrdiff_t>(node.panel_ld),
                            node.front_size(), node.pivot_size(),
                            inverse_diagonal.data() + 3 * node.first, work_rows.data());
  std::copy_n(work_rows.data(), pivots, pivot);
  const Scalar* from = work_rows.data() + pivots;
  for (const int rank : node.row_ranks) {
    Scalar* to = ordered_rows.data() + std::ptrdiff_t{3 * kDirections} * rank;
    for (int k = 0; k < 3 * kDirections; ++k) to[k] += *from++;
  }
}

template <class Scalar>
void SparseCholesky<Scalar>::Impl::backward_rows(const Node& node) const {
  const auto pivots = static_cast<std::size_t>(node.pivot_size() * kDirections);
  Scalar* pivot = ordered_rows.data() + std::ptrdiff_t{3 * kDirections} * node.first;
  std::copy_n(pivot, pivots, work_rows.data());
  Scalar* to = work_rows.data() + pivots;
  for (const int rank : node.row_ranks) {
    const Scalar* from = ordered_rows.data() + std::ptrdiff_t{3 * kDirections} * rank;
    to = std::copy_n(from, 3 * kDirections, to);
  }
  dense::solve_backward_rows(panel(node), static_cast<std::ptrdiff_t>(node.panel_ld),
                             node.front_size(), node.pivot_size(),
                             inverse_diagonal.data() + 3 * node.first, work_rows.data());
  std::copy_n(work_rows.data(), pivots, pivot);
}

template <class Scalar>
void SparseCholesky<Scalar>::solve(Directions& b) const {
  const Impl& s = *impl_;
  const std::vector<int>& order = s.structure->order;
  constexpr std::size_t kBlock = 3 * kDirections;  // of a vertex
  s.ordered_rows.resize(kBlock * order.size());
  s.work_rows.resize(s.work.size() * kDirections);
  Scalar* ordered = s.ordered_rows.data();
  for (std::size_t k = 0; k < order.size(); ++k) {
    const double* from = b.data() + kBlock * static_cast<std::size_t>(order[k]);
    for (std::size_t i = 0; i < kBlock; ++i) ordered[kBlock * k + i] = static_cast<Scalar>(from[i]);
  }
  for (const Node& node : s.nodes) s.forward_rows(node);
  for (auto node = s.nodes.rbegin(); node != s.nodes.rend(); ++node) s.backward_rows(*node);
  b.setZero();  // where vertices are held
  for (std::size_t k = 0; k < order.size(); ++k) {
    double* to = b.data() + kBlock * static_cast<std::size_t>(order[k]);
    for (std::size_t i = 0; i < kBlock; ++i) to[i] = ordered[kBlock * k + i];
  }
}

template class SparseCholesky<double>;
template class SparseCholesky<float>;

}  // namespace weft
