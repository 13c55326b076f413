#pragma once
/// The state of an XPBD simulation and what is done with all of its constraints at once.
#include <functional>

#include "weft/base/worker_team.h"
#include "weft/dynamics/xpbd_packs.h"

namespace weft::xpbd {

/// So many vertices of a slab, their constraints' data apart, stay in the second-level cache.
inline constexpr int kVerticesPerSlab = 2500;

class System {
 public:
  /// `inverse_masses`: 1/kg, one a vertex of the mesh, 0 for a pinned one. Starts at the origin,
  /// without constraints. `threads`: 0 for all cores; the results do not depend on it.
  System(const TriangleMesh& mesh, const VecX& inverse_masses, int threads,
         int vertices_per_slab = kVerticesPerSlab);
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  /// Constraints on the mesh's vertices `stencils`, K::kVertices each.
  template <class K>
  PackedConstraints<K>& add(const std::vector<int>& stencils,
                            const std::vector<typename K::template Rest<double>>& rest,
                            const typename K::Law& law) {
    std::vector<int> renumbered;
    for (const int i : stencils) renumbered.push_back(order_.index[static_cast<std::size_t>(i)]);
    auto set = std::make_unique<PackedConstraints<K>>(renumbered, rest, law, order_, scheduler_);
    PackedConstraints<K>& added = *set;
    adopt(std::move(set));
    return added;
  }

  /// Jacobi sweeps from now on (or Gauss-Seidel, as at the start).
  void set_sweep(XpbdSweep sweep);
  /// Equation 3 and 4 for each constraint once.
  void sweep(Derivatives derivatives);
  /// `pull` and, with derivatives, `dpull` become the sums of a pass that changes nothing else.
  void gather(Pass pass, Derivatives derivatives);
  void forget_multipliers();
  /// Multipliers (and, with derivatives, theirs) as they are where the shape is at rest.
  void balance_multipliers(Derivatives derivatives);
  /// Strains depend on the shape alone from here on, until it moves.
  void forget_strains();
  /// Derivatives of everything are zero from here on.
  void start_derivatives();

  void set_positions(const Points& x);
  Points positions() const;
  /// Records by the mesh's numbering.
  Points by_mesh(const Records& records) const;

  const SlabOrder& order() const { return order_; }
  int vertex_count() const { return static_cast<int>(order_.original.size()); }
  std::size_t constraint_count() const;
  int colours() const;
  Vertices& vertices() { return vertices_; }
  /// Of vertex i (new index), 1/kg.
  double inverse_mass(std::size_t i) const { return inverse_masses_[i]; }
  void set_inverse_mass(std::size_t i, double inverse_mass) {
    inverse_masses_[i] = inverse_mass;
    vertices_.x[i].w = parts_[i] * inverse_mass;
  }
  /// Runs task(slab) for all slabs, on the system's threads.
  template <class Task>
  void for_slabs(const Task& task) const {
    parallel(static_cast<std::size_t>(order_.slab_count()), task);
  }

 private:
  void adopt(std::unique_ptr<ConstraintSet> set);
  void split_vertices();
  void run(Pass pass, Derivatives derivatives);
  void parallel(std::size_t count, const std::function<void(std::size_t)>& task) const;

  SlabOrder order_;
  Scheduler scheduler_;
  std::vector<std::unique_ptr<ConstraintSet>> sets_;
  std::vector<double> inverse_masses_;
  std::vector<double> parts_;  // [new index], into how many a Jacobi sweep splits a vertex
  Vertices vertices_;
  XpbdSweep sweep_ = XpbdSweep::gauss_seidel;
  std::unique_ptr<WorkerTeam> team_;  // none for one thread or one slab
};

}  // namespace weft::xpbd
