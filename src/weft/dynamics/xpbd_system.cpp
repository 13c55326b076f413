#include "weft/dynamics/xpbd_system.h"

#include "weft/base/parallel.h"

namespace weft::xpbd {
System::System(const TriangleMesh& mesh, const VecX& inverse_masses, int threads,
               int vertices_per_slab)
    : order_(slab_order(mesh, vertices_per_slab)), scheduler_(order_) {
  const int wanted = all_threads(threads);
  if (wanted > 1 && order_.slab_count() > 1)
    team_ = std::make_unique<WorkerTeam>(std::min(wanted, order_.slab_count()));
  for (const int i : order_.original) inverse_masses_.push_back(inverse_masses[i]);
  vertices_.x.resize(order_.original.size() + at(order_.slab_count()));
  vertices_.pull.resize(vertices_.x.size());
  parts_.resize(inverse_masses_.size());
  split_vertices();
}

void System::adopt(std::unique_ptr<ConstraintSet> set) {
  sets_.push_back(std::move(set));
  split_vertices();
}

void System::set_sweep(XpbdSweep sweep) {
  sweep_ = sweep;
  split_vertices();
}

/// In a Jacobi sweep each vertex is split among its constraints: the local systems see a vertex as
/// often lighter.
void System::split_vertices() {
  std::vector<int> touching(vertices_.x.size(), 0);
  for (const auto& set : sets_) set->count(touching);
  for (std::size_t i = 0; i < inverse_masses_.size(); ++i) {
    parts_[i] = sweep_ == XpbdSweep::jacobi ? touching[i] : 1;
    set_inverse_mass(i, inverse_masses_[i]);
  }
}

void System::parallel(std::size_t count, const std::function<void(std::size_t)>& task) const {
  if (team_ != nullptr) {
    team_->run(count, task);
  } else {
    for (std::size_t i = 0; i < count; ++i) task(i);
  }
}

void System::run(Pass pass, Derivatives derivatives) {
  const std::size_t slabs = at(order_.slab_count());
  const std::array<std::size_t, 3> tasks{slabs, slabs - 1, 1};
  for (std::size_t phase = 0; phase < tasks.size(); ++phase) {
    if (tasks[phase] == 0) continue;
    parallel(tasks[phase], [&](std::size_t task) {
      for (const auto& set : sets_) set->run(pass, phase, task, derivatives, vertices_);
    });
  }
}

void System::gather(Pass pass, Derivatives derivatives) {
  std::fill(vertices_.pull.begin(), vertices_.pull.end(), Record{});
  if (derivatives == Derivatives::all)
    std::fill(vertices_.dpull.begin(), vertices_.dpull.end(), Record{});
  run(pass, derivatives);
}

void System::sweep(Derivatives derivatives) {
  if (sweep_ == XpbdSweep::gauss_seidel) {
    run(Pass::gauss_seidel, derivatives);
    return;
  }
  gather(Pass::jacobi, derivatives);
  for_slabs([&](std::size_t slab) {
    for (std::size_t i = at(order_.first[slab]); i < at(order_.first[slab + 1]); ++i) {
      const double w = inverse_masses_[i];
      Record& x = vertices_.x[i];
      const Record& p = vertices_.pull[i];
      x = {x.x + w * p.x, x.y + w * p.y, x.z + w * p.z, x.w};
      if (derivatives == Derivatives::none) continue;
      for (std::size_t k = kSheetParameters * i; k < kSheetParameters * (i + 1); ++k) {
        Record& dx = vertices_.dx[k];
        const Record& dp = vertices_.dpull[k];
        dx = {dx.x + w * dp.x, dx.y + w * dp.y, dx.z + w * dp.z, 0};
      }
    }
  });
}

void System::forget_multipliers() {
  for (const auto& set : sets_) set->forget_multipliers();
}

void System::balance_multipliers(Derivatives derivatives) { run(Pass::balance, derivatives); }

void System::forget_strains() {
  for (const auto& set : sets_) set->forget_strains();
}

void System::start_derivatives() {
  vertices_.dx.assign(kSheetParameters * vertices_.x.size(), Record{});
  vertices_.dpull = vertices_.dx;
  for (const auto& set : sets_) set->follow_derivatives();
}

void System::set_positions(const Points& x) {
  for (std::size_t i = 0; i < order_.original.size(); ++i) {
    const auto p = x.col(order_.original[i]);
    vertices_.x[i] = {p.x(), p.y(), p.z(), vertices_.x[i].w};
  }
}

Points System::positions() const { return by_mesh(vertices_.x); }

Points System::by_mesh(const Records& records) const {
  Points out(3, vertex_count());
  for (std::size_t i = 0; i < order_.original.size(); ++i)
    out.col(order_.original[i]) << records[i].x, records[i].y, records[i].z;
  return out;
}

std::size_t System::constraint_count() const {
  std::size_t sum = 0;
  for (const auto& set : sets_) sum += set->size();
  return sum;
}

int System::colours() const {
  int sum = 0;
  for (const auto& set : sets_) sum += set->colours();
  return sum;
}

}  // namespace weft::xpbd
