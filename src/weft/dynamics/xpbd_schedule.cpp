#include "weft/dynamics/xpbd_schedule.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace weft::xpbd {
SlabOrder slab_order(const TriangleMesh& mesh, int vertices_per_slab) {
  const int n = mesh.vertex_count();
  const Vec2 lower = mesh.material.rowwise().minCoeff();
  const Vec2 extent = mesh.material.rowwise().maxCoeff() - lower;
  const int across = extent.y() >= extent.x() ? 1 : 0;
  const double cell = std::sqrt(extent.x() * extent.y() / n);
  // Lines of one cell's thickness; half a cell off, so that the lines of a grid are not on borders.
  const auto line = [&](int i) {
    return static_cast<long>(std::floor((mesh.material(across, i) - lower[across]) / cell + 0.5));
  };
  SlabOrder out;
  out.original.resize(at(n));
  std::iota(out.original.begin(), out.original.end(), 0);
  std::stable_sort(out.original.begin(), out.original.end(), [&](int a, int b) {
    if (line(a) != line(b)) return line(a) < line(b);
    return mesh.material(1 - across, a) < mesh.material(1 - across, b);
  });
  out.index.resize(at(n));
  for (int i = 0; i < n; ++i) out.index[at(out.original[at(i)])] = i;

  // Slabs end where a line does.
  const int slabs = std::max(1, n / vertices_per_slab);
  out.first = {0};
  for (int slab = 1; slab < slabs; ++slab) {
    int border = static_cast<int>(static_cast<long>(n) * slab / slabs);
    while (border < n && line(out.original[at(border)]) == line(out.original[at(border - 1)]))
      ++border;
    if (border > out.first.back() && border < n) out.first.push_back(border);
  }
  out.first.push_back(n);
  out.slab_of_vertex.resize(at(n));
  for (int slab = 0; slab < out.slab_count(); ++slab)
    for (int i = out.first[at(slab)]; i < out.first[at(slab) + 1]; ++i)
      out.slab_of_vertex[at(i)] = slab;
  return out;
}

Scheduler::Scheduler(const SlabOrder& order)
    : order_(order), border_of_vertex_(order.original.size(), -1) {}

Scheduler::Place Scheduler::place(std::span<const int> stencil) {
  int low = order_.slab_count(), high = -1;
  for (const int i : stencil) {
    low = std::min(low, order_.slab_of_vertex[at(i)]);
    high = std::max(high, order_.slab_of_vertex[at(i)]);
  }
  if (low == high) return {0, at(low)};
  const bool free = high == low + 1 && std::all_of(stencil.begin(), stencil.end(), [&](int i) {
                      return border_of_vertex_[at(i)] < 0 || border_of_vertex_[at(i)] == low;
                    });
  if (!free) return {2, 0};
  for (const int i : stencil) border_of_vertex_[at(i)] = low;
  return {1, at(low)};
}

Schedule Scheduler::add(std::span<const int> stencils, int width, int pack_size) {
  const std::size_t w = at(width), count = stencils.size() / w;
  std::array<std::vector<std::vector<int>>, 3> members;
  members[0].resize(at(order_.slab_count()));
  members[1].resize(at(order_.slab_count() - 1));
  members[2].resize(1);
  for (std::size_t c = 0; c < count; ++c) {
    const Place to = place(stencils.subspan(c * w, w));
    members[to.phase][to.task].push_back(static_cast<int>(c));
  }
  Schedule schedule;
  for (std::size_t phase = 0; phase < 3; ++phase) {
    for (std::vector<int>& task : members[phase]) {
      std::sort(task.begin(), task.end(), [&](int a, int b) {
        const auto first = [&](int c) {
          const auto s = stencils.subspan(at(c) * w, w);
          return *std::min_element(s.begin(), s.end());
        };
        return std::pair(first(a), a) < std::pair(first(b), b);
      });
      std::vector<int> own;
      for (const int c : task)
        own.insert(own.end(), stencils.begin() + static_cast<std::ptrdiff_t>(at(c) * w),
                   stencils.begin() + static_cast<std::ptrdiff_t>(at(c) * w + w));
      const std::vector<int> colour = colours(own, width, static_cast<int>(order_.original.size()));
      const int used = colour.empty() ? 0 : *std::max_element(colour.begin(), colour.end()) + 1;
      schedule.colours = std::max(schedule.colours, used);
      TaskRange range{schedule.order.size(), 0};
      for (int k = 0; k < used; ++k) {
        for (std::size_t i = 0; i < task.size(); ++i)
          if (colour[i] == k) schedule.order.push_back(task[i]);
        while (schedule.order.size() % at(pack_size) != 0) schedule.order.push_back(-1);
      }
      range.end = schedule.order.size();
      schedule.tasks[phase].push_back(range);
    }
  }
  return schedule;
}

std::vector<int> colours(std::span<const int> stencils, int width, int vertex_count) {
  const std::size_t w = at(width), count = stencils.size() / w;
  std::vector<std::vector<char>> taken(at(vertex_count));  // [vertex][colour]
  std::vector<int> out(count);
  for (std::size_t c = 0; c < count; ++c) {
    const auto stencil = stencils.subspan(c * w, w);
    int colour = 0;
    const auto is_taken = [&](int i) {
      return at(colour) < taken[at(i)].size() && taken[at(i)][at(colour)] != 0;
    };
    while (std::any_of(stencil.begin(), stencil.end(), is_taken)) ++colour;
    for (const int i : stencil) {
      if (taken[at(i)].size() <= at(colour)) taken[at(i)].resize(at(colour) + 1, 0);
      taken[at(i)][at(colour)] = 1;
    }
    out[c] = colour;
  }
  return out;
}

}  // namespace weft::xpbd
