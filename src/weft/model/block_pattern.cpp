#include "weft/model/block_pattern.h"

#include <algorithm>

namespace weft::detail {
BlockPattern::BlockPattern(int vertex_count) : rows_(at(vertex_count)) {
  for (int v = 0; v < vertex_count; ++v) rows_[at(v)].push_back(v);
}

void BlockPattern::add_element(std::span<const int> vertices) {
  for (const int a : vertices)
    for (const int b : vertices)
      if (b > a) rows_[at(a)].push_back(b);
}

void BlockPattern::finish() {
  const int n = static_cast<int>(rows_.size());
  std::vector<Eigen::Triplet<double, int>> entries;
  for (int v = 0; v < n; ++v) {
    auto& rows = rows_[at(v)];
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    for (const int row : rows)
      for (int c = 0; c < 3; ++c)
        for (int r = row == v ? c : 0; r < 3; ++r)
          entries.emplace_back(3 * row + r, 3 * v + c, 0.0);
  }
  matrix_.resize(3 * n, 3 * n);
  matrix_.setFromTriplets(entries.begin(), entries.end());
  matrix_.makeCompressed();
  for (int v = 0; v < n; ++v) {
    const int start = matrix_.outerIndexPtr()[3 * v];
    columns_.push_back({start, matrix_.outerIndexPtr()[3 * v + 1] - start});
  }
}

std::vector<int> BlockPattern::diagonal_slots() const {
  std::vector<int> slots;
  for (const auto& [start, length] : columns_)
    slots.insert(slots.end(), {start, start + length, start + 2 * length - 1});
  return slots;
}

int BlockPattern::slot(int row, int column) const {
  const int low = std::min(row, column), high = std::max(row, column);
  const auto& list = rows_[at(low)];
  const auto found = std::lower_bound(list.begin(), list.end(), high);
  const int slot = columns_[at(low)].start + 3 * static_cast<int>(found - list.begin());
  return row >= column ? slot : ~slot;
}

void BlockPattern::add_diagonal(
    double* values, int vertex,
    const Eigen::Ref<const Mat3, 0, Eigen::OuterStride<>>& block) const {
  const ColumnLayout column = columns_[at(vertex)];
  double* c0 = values + column.start;
  double* c1 = c0 + column.length;
  double* c2 = c1 + column.length - 1;
  c0[0] += block(0, 0);
  c0[1] += block(1, 0);
  c0[2] += block(2, 0);
  c1[0] += block(1, 1);
  c1[1] += block(2, 1);
  c2[0] += block(2, 2);
}

void BlockPattern::add_off_diagonal(
    double* values, int row, int column, int slot,
    const Eigen::Ref<const Mat3, 0, Eigen::OuterStride<>>& block) const {
  if (row == column) {
    const Mat3 symmetric = block + block.transpose();
    add_diagonal(values, row, symmetric);
    return;
  }
  const bool transposed = slot < 0;
  const int length = columns_[at(transposed ? row : column)].length;
  double* c0 = values + (transposed ? ~slot : slot);
  double* c1 = c0 + length - 1;
  double* c2 = c1 + length - 2;
  for (int r = 0; r < 3; ++r) {
    c0[r] += transposed ? block(0, r) : block(r, 0);
    c1[r] += transposed ? block(1, r) : block(r, 1);
    c2[r] += transposed ? block(2, r) : block(r, 2);
  }
}

}  // namespace weft::detail
