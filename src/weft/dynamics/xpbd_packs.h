#pragma once
/// Constraints of one kind, kLanes at a time.
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "weft/dynamics/xpbd_constraints.h"
#include "weft/dynamics/xpbd_schedule.h"

namespace weft::xpbd {

/// Four numbers of a vertex side by side, one load: position (or force) and, in positions, the
/// inverse mass that the local systems see.
struct alignas(32) Record {
  double x = 0, y = 0, z = 0, w = 0;
};
using Records = std::vector<Record>;

/// Where a sweep reads and writes. One more vertex than the mesh has for each task of a phase: the
/// lanes without a constraint stand on it; its inverse mass is zero. Derivatives have
/// kSheetParameters records a vertex, side by side.
struct Vertices {
  Records x;
  /// Sums of grad C times multipliers; w, in Pass::warm: sums of turning() (xpbd_constraints.h).
  Records pull;
  Records dx, dpull;
};

/// What is done with each constraint.
enum class Pass {
  gauss_seidel,  ///< change multipliers and positions
  jacobi,        ///< change multipliers; what they pull is added to `pull`
  warm,          ///< add what the multipliers pull to `pull`
  elastic,       ///< add the elastic force to `pull`
  balance,       ///< set multipliers to what the strains make of them at rest
};

/// Which derivatives by the sheet's parameters are computed, too.
enum class Derivatives { none, all };

class ConstraintSet {
 public:
  virtual ~ConstraintSet() = default;
  virtual void run(Pass pass, std::size_t phase, std::size_t task, Derivatives derivatives,
                   Vertices& vertices) = 0;
  /// Multipliers, and their derivatives, are zero again.
  virtual void forget_multipliers() = 0;
  /// So is what strains remember.
  virtual void forget_strains() = 0;
  virtual void follow_derivatives() = 0;
  virtual std::size_t size() const = 0;
  virtual int colours() const = 0;
  /// Adds 1 for each constraint to each of its vertices.
  virtual void count(std::vector<int>& of_vertex) const = 0;
};

/// Coordinates of kLanes vertices.
struct LaneRecords {
  Vector3<Lanes> v;
  Lanes w;
};

namespace detail {

using Quad = double __attribute__((vector_size(32), may_alias));

#if defined(__GNUC__) && defined(__AVX__)
inline Quad load(const Record& r) { return *reinterpret_cast<const Quad*>(&r); }
inline void store(const Quad& q, Record& r) { *reinterpret_cast<Quad*>(&r) = q; }
#endif

/// `stride` records lie between two vertices.
inline LaneRecords gather(const Record* records, const std::int32_t* index, std::ptrdiff_t stride) {
#if defined(__AVX512F__)
  const auto pair = [&](int i) {
    return __builtin_shufflevector(load(records[stride * index[i]]),
                                   load(records[stride * index[i + 4]]), 0, 1, 2, 3, 4, 5, 6, 7);
  };
  const Lanes a = pair(0), b = pair(1), c = pair(2), d = pair(3);
  const Lanes ab_even = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
  const Lanes ab_odd = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  const Lanes cd_even = __builtin_shufflevector(c, d, 0, 8, 2, 10, 4, 12, 6, 14);
  const Lanes cd_odd = __builtin_shufflevector(c, d, 1, 9, 3, 11, 5, 13, 7, 15);
  return {{__builtin_shufflevector(ab_even, cd_even, 0, 1, 8, 9, 4, 5, 12, 13),
           __builtin_shufflevector(ab_odd, cd_odd, 0, 1, 8, 9, 4, 5, 12, 13),
           __builtin_shufflevector(ab_even, cd_even, 2, 3, 10, 11, 6, 7, 14, 15)},
          __builtin_shufflevector(ab_odd, cd_odd, 2, 3, 10, 11, 6, 7, 14, 15)};
#elif defined(__AVX__)
  const Quad a = load(records[stride * index[0]]), b = load(records[stride * index[1]]);
  const Quad c = load(records[stride * index[2]]), d = load(records[stride * index[3]]);
  const Quad ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6);
  const Quad ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Quad cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6);
  const Quad cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  return {{__builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5),
           __builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5),
           __builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7)},
          __builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7)};
#else
  LaneRecords out;
  for (int i = 0; i < kLanes; ++i) {
    const Record& r = records[stride * index[i]];
    out.v.x[i] = r.x;
    out.v.y[i] = r.y;
    out.v.z[i] = r.z;
    out.w[i] = r.w;
  }
  return out;
#endif
}

/// The inverse of gather(); of vertices that are equal, those with the same values.
inline void scatter(const Vector3<Lanes>& v, const Lanes& w, Record* records,
                    const std::int32_t* index, std::ptrdiff_t stride) {
#if defined(__AVX512F__)
  const Lanes ab_even = __builtin_shufflevector(v.x, v.z, 0, 1, 8, 9, 4, 5, 12, 13);
  const Lanes ab_odd = __builtin_shufflevector(v.y, w, 0, 1, 8, 9, 4, 5, 12, 13);
  const Lanes cd_even = __builtin_shufflevector(v.x, v.z, 2, 3, 10, 11, 6, 7, 14, 15);
  const Lanes cd_odd = __builtin_shufflevector(v.y, w, 2, 3, 10, 11, 6, 7, 14, 15);
  const auto put = [&](const Lanes& pair, int i) {
    store(__builtin_shufflevector(pair, pair, 0, 1, 2, 3), records[stride * index[i]]);
    store(__builtin_shufflevector(pair, pair, 4, 5, 6, 7), records[stride * index[i + 4]]);
  };
  put(__builtin_shufflevector(ab_even, ab_odd, 0, 8, 2, 10, 4, 12, 6, 14), 0);
  put(__builtin_shufflevector(ab_even, ab_odd, 1, 9, 3, 11, 5, 13, 7, 15), 1);
  put(__builtin_shufflevector(cd_even, cd_odd, 0, 8, 2, 10, 4, 12, 6, 14), 2);
  put(__builtin_shufflevector(cd_even, cd_odd, 1, 9, 3, 11, 5, 13, 7, 15), 3);
#elif defined(__AVX__)
  const Quad ab_even = __builtin_shufflevector(v.x, v.z, 0, 1, 4, 5);
  const Quad ab_odd = __builtin_shufflevector(v.y, w, 0, 1, 4, 5);
  const Quad cd_even = __builtin_shufflevector(v.x, v.z, 2, 3, 6, 7);
  const Quad cd_odd = __builtin_shufflevector(v.y, w, 2, 3, 6, 7);
  store(__builtin_shufflevector(ab_even, ab_odd, 0, 4, 2, 6), records[stride * index[0]]);
  store(__builtin_shufflevector(ab_even, ab_odd, 1, 5, 3, 7), records[stride * index[1]]);
  store(__builtin_shufflevector(cd_even, cd_odd, 0, 4, 2, 6), records[stride * index[2]]);
  store(__builtin_shufflevector(cd_even, cd_odd, 1, 5, 3, 7), records[stride * index[3]]);
#else
  for (int i = 0; i < kLanes; ++i) records[stride * index[i]] = {v.x[i], v.y[i], v.z[i], w[i]};
#endif
}

template <std::size_t V>
inline void add(const std::array<Vector3<Lanes>, V>& change, Record* records,
                const std::int32_t* index, std::ptrdiff_t stride) {
  for (std::size_t i = 0; i < V; ++i) {
    const std::int32_t* at = index + static_cast<std::ptrdiff_t>(i) * kLanes;
    const LaneRecords old = gather(records, at, stride);
    scatter(old.v + change[i], old.w, records, at, stride);
  }
}

}  // namespace detail

/// Does `change(rest, strain, dx)` exist?
template <class K>
concept HasDerivatives = requires {
  &K::template change<Lanes>;
};

/// Does the strain depend on the one before?
template <class K>
concept HasMemory = requires {
  &K::template remember<Lanes>;
};

template <class K>
class PackedConstraints final : public ConstraintSet {
 public:
  static constexpr std::size_t kVertices = K::kVertices, kRows = K::kRows;
  using Law = typename K::Law;
  using Rest = typename K::template Rest<double>;

  /// `stencils`: kVertices vertices (new indices) a constraint. Where one comes a second time in a
  /// stencil (the apex of a hinge on the rim), nothing may depend on it. `rest`: one a constraint.
  PackedConstraints(std::span<const int> stencils, const std::vector<Rest>& rest, const Law& law,
                    const SlabOrder& order, Scheduler& scheduler)
      : law_(law), size_(rest.size()) {
    const Schedule schedule = scheduler.add(stencils, static_cast<int>(kVertices), kLanes);
    colours_ = schedule.colours;
    tasks_ = schedule.tasks;
    packs_.resize(schedule.order.size() / kLanes);
    for (const auto& phase : tasks_)
      for (std::size_t task = 0; task < phase.size(); ++task)
        for (std::size_t i = phase[task].begin; i < phase[task].end; ++i) {
          const int c = schedule.order[i];
          const int spare = static_cast<int>(order.original.size() + task);
          fill(packs_[i / kLanes], static_cast<int>(i % kLanes), c, spare, stencils, rest);
        }
  }

  void set_law(const Law& law) { law_ = law; }

  void run(Pass pass, std::size_t phase, std::size_t task, Derivatives derivatives,
           Vertices& vertices) override {
    const TaskRange range = tasks_[phase][task];
    const std::size_t begin = range.begin / kLanes, end = range.end / kLanes;
    if constexpr (HasDerivatives<K>) {
      if (derivatives == Derivatives::all) {
        run_pass<Derivatives::all>(pass, begin, end, vertices);
        return;
      }
    }
    run_pass<Derivatives::none>(pass, begin, end, vertices);
  }

  void forget_multipliers() override {
    for (Pack& pack : packs_) pack.l.fill(Lanes{});
    for (DerivativePack& pack : derivatives_) pack = {};
  }
  void forget_strains() override {
    if constexpr (HasMemory<K>)
      for (Pack& pack : packs_) K::forget(pack.rest);
  }
  void follow_derivatives() override { derivatives_.assign(packs_.size(), DerivativePack{}); }
  std::size_t size() const override { return size_; }
  int colours() const override { return colours_; }
  void count(std::vector<int>& of_vertex) const override {
    for (const Pack& pack : packs_)
      for (const std::int32_t i : pack.index) ++of_vertex[static_cast<std::size_t>(i)];
  }

 private:
  struct Pack {
    alignas(64) std::array<std::int32_t, kVertices * kLanes> index;  // by vertex, then lane
    typename K::template Rest<Lanes> rest;
    Rows<Lanes, kRows> l{};
  };
  struct DerivativePack {
    std::array<Rows<Lanes, kRows>, kSheetParameters> l{};
  };

  /// Rest<double> and Rest<Lanes> are the same numbers, one or kLanes of each.
  static void fill(Pack& pack, int lane, int constraint, int spare, std::span<const int> stencils,
                   const std::vector<Rest>& rest) {
    const std::size_t c = constraint < 0 ? 0 : static_cast<std::size_t>(constraint);
    const auto stencil = stencils.subspan(c * kVertices, kVertices);
    for (std::size_t v = 0; v < kVertices; ++v) {
      const auto before = stencil.begin() + static_cast<std::ptrdiff_t>(v);
      const bool none = constraint < 0 || std::find(stencil.begin(), before, stencil[v]) != before;
      pack.index[v * kLanes + static_cast<std::size_t>(lane)] = none ? spare : stencil[v];
    }
    static_assert(sizeof(pack.rest) == kLanes * sizeof(Rest));
    const double* from = reinterpret_cast<const double*>(&rest[c]);
    auto* to = reinterpret_cast<Lanes*>(&pack.rest);
    for (std::size_t i = 0; i < sizeof(Rest) / sizeof(double); ++i) to[i][lane] = from[i];
  }

  template <Derivatives kDerivatives>
  void run_pass(Pass pass, std::size_t begin, std::size_t end, Vertices& vertices) {
    switch (pass) {
      case Pass::gauss_seidel:
        return loop<Pass::gauss_seidel, kDerivatives>(begin, end, vertices);
      case Pass::jacobi:
        return loop<Pass::jacobi, kDerivatives>(begin, end, vertices);
      case Pass::warm:
        return loop<Pass::warm, kDerivatives>(begin, end, vertices);
      case Pass::elastic:
        return loop<Pass::elastic, kDerivatives>(begin, end, vertices);
      case Pass::balance:
        return loop<Pass::balance, kDerivatives>(begin, end, vertices);
    }
  }

  template <Pass kPass, Derivatives kDerivatives>
  void loop(std::size_t begin, std::size_t end, Vertices& vertices) {
    for (std::size_t i = begin; i < end; ++i) {
      DerivativePack* derivative = nullptr;
      if constexpr (kDerivatives == Derivatives::all) derivative = &derivatives_[i];
      work<kPass, kDerivatives>(packs_[i], derivative, vertices);
    }
  }

  static const std::int32_t* index_of(const Pack& pack, std::size_t v) {
    return pack.index.data() + v * kLanes;
  }

  // Everything inlined: vectors of lanes are to stay in registers.
  template <Pass kPass, Derivatives kDerivatives>
  [[gnu::flatten]] void work(Pack& pack, DerivativePack* derivative, Vertices& vertices) const {
    std::array<Vector3<Lanes>, kVertices> x;
    std::array<Lanes, kVertices> w;
    for (std::size_t v = 0; v < kVertices; ++v) {
      const LaneRecords r = detail::gather(vertices.x.data(), index_of(pack, v), 1);
      x[v] = r.v;
      w[v] = r.w;
    }
    const auto strain = K::strain(pack.rest, x);
    if constexpr (HasMemory<K>) K::remember(strain, pack.rest);
    if constexpr (kPass == Pass::balance) {
      const auto c = strain.value();
      pack.l = scaled(law_.squared_step(), law_.stress(pack.rest.weight(), c));
      if constexpr (kDerivatives == Derivatives::all) {
        for (int p = 0; p < kSheetParameters; ++p) {
          const auto dc = K::change(pack.rest, strain, direction(pack, p, vertices)).value();
          derivative->l[static_cast<std::size_t>(p)] =
              scaled(law_.squared_step(), law_.stress_derivative(p, pack.rest.weight(), c, dc));
        }
      }
      return;
    }
    if constexpr (kPass == Pass::warm || kPass == Pass::elastic) {
      const auto c = strain.value();
      const Rows<Lanes, kRows> l =
          kPass == Pass::warm ? pack.l : law_.stress(pack.rest.weight(), c);
      const auto pull = strain.pull(l);
      std::array<Lanes, kVertices> turning{};
      if constexpr (kPass == Pass::warm) turning = strain.turning(l);
      for (std::size_t v = 0; v < kVertices; ++v) {
        const LaneRecords old = detail::gather(vertices.pull.data(), index_of(pack, v), 1);
        detail::scatter(old.v + pull[v], old.w + turning[v], vertices.pull.data(),
                        index_of(pack, v), 1);
      }
      if constexpr (kDerivatives == Derivatives::all) {
        for (int p = 0; p < kSheetParameters; ++p) {
          const auto change = K::change(pack.rest, strain, direction(pack, p, vertices));
          const Rows<Lanes, kRows> dl =
              kPass == Pass::warm
                  ? derivative->l[static_cast<std::size_t>(p)]
                  : law_.stress_derivative(p, pack.rest.weight(), c, change.value());
          add_direction(pack, p, sum(change.pull(l), strain.pull(dl)), vertices.dpull);
        }
      }
    } else {
      const auto solution =
          law_.solve(pack.rest.weight(), strain.value(), strain.mobility(w), pack.l);
      const Rows<Lanes, kRows>& dl = solution.change;
      for (std::size_t k = 0; k < kRows; ++k) pack.l[k] = pack.l[k] + dl[k];
      const auto pull = strain.pull(dl);
      if constexpr (kPass == Pass::gauss_seidel) {
        for (std::size_t v = 0; v < kVertices; ++v)
          detail::scatter(x[v] + w[v] * pull[v], w[v], vertices.x.data(), index_of(pack, v), 1);
      } else {
        detail::add(pull, vertices.pull.data(), pack.index.data(), 1);
      }
      if constexpr (kDerivatives == Derivatives::all) {
        for (int p = 0; p < kSheetParameters; ++p) {
          const auto change = K::change(pack.rest, strain, direction(pack, p, vertices));
          Rows<Lanes, kRows>& kept = derivative->l[static_cast<std::size_t>(p)];
          const Rows<Lanes, kRows> ddl =
              solution.derivative(p, change.value(), change.mobility(w) * dl, kept);
          for (std::size_t k = 0; k < kRows; ++k) kept[k] = kept[k] + ddl[k];
          auto dpull = sum(change.pull(dl), strain.pull(ddl));
          if constexpr (kPass == Pass::gauss_seidel) {
            for (std::size_t v = 0; v < kVertices; ++v) dpull[v] = w[v] * dpull[v];
            add_direction(pack, p, dpull, vertices.dx);
          } else {
            add_direction(pack, p, dpull, vertices.dpull);
          }
        }
      }
    }
  }

  static Rows<Lanes, kRows> scaled(double factor, Rows<Lanes, kRows> l) {
    for (Lanes& entry : l) entry = factor * entry;
    return l;
  }
  static std::array<Vector3<Lanes>, kVertices> direction(const Pack& pack, int p,
                                                         const Vertices& vertices) {
    std::array<Vector3<Lanes>, kVertices> dx;
    for (std::size_t v = 0; v < kVertices; ++v)
      dx[v] = detail::gather(vertices.dx.data() + p, index_of(pack, v), kSheetParameters).v;
    return dx;
  }
  static void add_direction(const Pack& pack, int p,
                            const std::array<Vector3<Lanes>, kVertices>& change, Records& to) {
    detail::add(change, to.data() + p, pack.index.data(), kSheetParameters);
  }
  static std::array<Vector3<Lanes>, kVertices> sum(std::array<Vector3<Lanes>, kVertices> a,
                                                   const std::array<Vector3<Lanes>, kVertices>& b) {
    for (std::size_t v = 0; v < kVertices; ++v) a[v] = a[v] + b[v];
    return a;
  }

  Law law_;
  std::size_t size_ = 0;
  int colours_ = 0;
  TaskRanges tasks_;
  std::vector<Pack> packs_;
  std::vector<DerivativePack> derivatives_;
};

}  // namespace weft::xpbd
