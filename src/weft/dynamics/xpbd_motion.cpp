#include "weft/dynamics/xpbd_motion.h"

namespace weft::xpbd {

Motion::Motion(System& system, const Vec3& acceleration)
    : system_(system), acceleration_(acceleration) {
  v_.resize(static_cast<std::size_t>(system.vertex_count()));
  before_.resize(v_.size());
}

void Motion::advance(double step, int substeps, int sweeps) {
  const std::vector<int>& first = system_.order().first;
  const auto for_free = [&](const auto& task) {
    system_.for_slabs([&](std::size_t slab) {
      const auto end = static_cast<std::size_t>(first[slab + 1]);
      for (auto i = static_cast<std::size_t>(first[slab]); i < end; ++i)
        if (system_.inverse_mass(i) > 0) task(i);
    });
  };
  Records& x = system_.vertices().x;
  for (int k = 0; k < substeps; ++k) {
    system_.forget_multipliers();
    for_free([&](std::size_t i) {
      before_[i] = x[i];
      v_[i] = {v_[i].x + step * acceleration_.x(), v_[i].y + step * acceleration_.y(),
               v_[i].z + step * acceleration_.z(), 0};
      x[i] = {x[i].x + step * v_[i].x, x[i].y + step * v_[i].y, x[i].z + step * v_[i].z, x[i].w};
    });
    for (int sweep = 0; sweep < sweeps; ++sweep) system_.sweep(Derivatives::none);
    for_free([&](std::size_t i) {
      v_[i] = {(x[i].x - before_[i].x) / step, (x[i].y - before_[i].y) / step,
               (x[i].z - before_[i].z) / step, 0};
    });
  }
}

}  // namespace weft::xpbd
