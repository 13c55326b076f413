#pragma once
/// In which order the constraints of XPBD are worked off, and what may be done at the same time.
///
/// The vertices are cut into slabs of about equal count, across the longer side of the fabric. A
/// sweep has three phases: constraints within one slab, a task a slab; constraints across one
/// border between slabs, a task a border; the rest (those of slabs that are too thin), one task.
/// Tasks of a phase share no vertex and may run at once; the slabs depend on the mesh alone, so
/// that the result does not depend on the number of threads. Within a task, constraints are sorted
/// by colour: constraints of one colour share no vertex, and are worked off kLanes at a time.
#include <array>
#include <span>
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft::xpbd {

/// A numbering of the vertices in which slabs, and lines within a slab, are contiguous.
struct SlabOrder {
  std::vector<int> original;        ///< [new index]
  std::vector<int> index;           ///< [original index]
  std::vector<int> slab_of_vertex;  ///< [new index]
  std::vector<int> first;           ///< [slab], and the number of vertices at the end
  int slab_count() const { return static_cast<int>(first.size()) - 1; }
};
/// `vertices_per_slab` >= 1; a mesh with fewer than two times as many is one slab.
SlabOrder slab_order(const TriangleMesh& mesh, int vertices_per_slab);

/// A part of a constraint set that is worked off in one go, from `begin` to `end` in the order of
/// Schedule::order. Colours have a multiple of the pack's size; -1 stands for no constraint.
struct TaskRange {
  std::size_t begin = 0, end = 0;
};

/// Three phases, each a range a task.
using TaskRanges = std::array<std::vector<TaskRange>, 3>;

struct Schedule {
  std::vector<int> order;  ///< indices of constraints, or -1
  TaskRanges tasks;
  int colours = 0;  ///< the most in a task
};

/// Distributes constraints to phases and tasks. All sets of constraints of a solver are added one
/// after the other: which vertices a border's task may touch is common to them.
class Scheduler {
 public:
  explicit Scheduler(const SlabOrder& order);
  /// `stencils`: `width` vertices (new indices) a constraint; those that are equal count once.
  Schedule add(std::span<const int> stencils, int width, int pack_size);

 private:
  struct Place {
    std::size_t phase, task;
  };
  Place place(std::span<const int> stencil);

  const SlabOrder& order_;
  std::vector<int> border_of_vertex_;
};

/// Colours from 0, so that no two stencils of a colour share a vertex: each stencil in turn gets
/// the lowest colour that is free.
std::vector<int> colours(std::span<const int> stencils, int width, int vertex_count);

}  // namespace weft::xpbd
