/// Sweeps of XPBD: of the constraints of a sheet, and of those of a public peer,
/// PositionBasedDynamics (https://github.com/InteractiveComputerGraphics/PositionBasedDynamics), on
/// the same mesh: edge lengths and isometric bending. With -DWEFT_PBD_SOURCE and
/// -DWEFT_GENERIC_PARAMETERS_SOURCE (folders of the peer's sources and of GenericParameters, which
/// it needs) the peer runs beside it.
///
/// The scene is the peer's own cloth demo: a sheet of 10 m x 10 m, 1 kg a vertex, held at two
/// corners, let go from the horizontal; edges of 1e5 N/m, bending 100. What counts is the time of
/// an iteration at equal remaining strain of the edges, which is printed for the end of the run.
#include <benchmark/benchmark.h>

#include <cmath>

#include "weft/dynamics/xpbd_motion.h"
#include "weft/dynamics/xpbd_sheet.h"

#ifdef WEFT_HAS_PBD
#include <omp.h>

#include "Simulation/Simulation.h"
#include "Simulation/SimulationModel.h"
#include "Simulation/TimeManager.h"
#include "Simulation/TimeStepController.h"
#include "Utils/Logger.h"
#include "Utils/Timing.h"
INIT_LOGGING
INIT_TIMING
#endif

namespace weft {
namespace {

constexpr double kSize = 10;            // m
constexpr double kEdgeStiffness = 1e5;  // N/m
constexpr double kBendStiffness = 100;
constexpr double kFrame = 0.005;  // s
constexpr double kGravity = 9.81;

/// The peer's energy of isometric bending (Bergou et al. 2006) taken as a constraint: C = 3 / (4
/// (A_1
/// + A_2)) |sum k_i x_i|^2 with sums of cotangents k_i.
struct IsometricBend {
  static constexpr std::size_t kVertices = 4, kRows = 1;
  using Law = xpbd::ScalarLaw;
  template <class T>
  struct Rest {
    std::array<T, 4> k;
    T factor;  // 3 / (2 (A_1 + A_2))
    T one;
    const T& weight() const { return one; }
  };
  template <class T>
  struct Strain {
    const Rest<T>& rest;
    Vector3<T> sum;
    T squared;
    xpbd::Rows<T, 1> value() const { return {broadcast<T>(0.5) * rest.factor * squared}; }
    xpbd::Symmetric<T, 1> mobility(const std::array<T, 4>& w) const {
      T s = w[0] * rest.k[0] * rest.k[0];
      for (std::size_t i = 1; i < 4; ++i) s = s + w[i] * rest.k[i] * rest.k[i];
      return {s * rest.factor * rest.factor * squared};
    }
    std::array<Vector3<T>, 4> pull(const xpbd::Rows<T, 1>& l) const {
      const Vector3<T> p = (l[0] * rest.factor) * sum;
      return {rest.k[0] * p, rest.k[1] * p, rest.k[2] * p, rest.k[3] * p};
    }
    std::array<T, 4> turning(const xpbd::Rows<T, 1>&) const { return {}; }
  };
  template <class T>
  static Strain<T> strain(const Rest<T>& rest, const std::array<Vector3<T>, 4>& x) {
    const Vector3<T> sum =
        rest.k[0] * x[0] + rest.k[1] * x[1] + (rest.k[2] * x[2] + rest.k[3] * x[3]);
    return {rest, sum, dot(sum, sum)};
  }

  static Rest<double> at_rest(const Vec2& x0, const Vec2& x1, const Vec2& x2, const Vec2& x3) {
    const auto cotangent = [](const Vec2& a, const Vec2& b) {
      return a.dot(b) / std::abs(a.x() * b.y() - a.y() * b.x());
    };
    const auto area = [](const Vec2& a, const Vec2& b) {
      return 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
    };
    const Vec2 e = x1 - x0;
    const double c1 = cotangent(e, x2 - x0), c2 = cotangent(e, x3 - x0);
    const double c3 = cotangent(-e, x2 - x1), c4 = cotangent(-e, x3 - x1);
    return {{c3 + c4, c1 + c2, -c1 - c3, -c2 - c4}, 1.5 / (area(e, x2 - x0) + area(e, x3 - x0)), 1};
  }
};

struct Edges {
  std::vector<std::array<int, 2>> ends;
  std::vector<double> lengths;

  explicit Edges(const TriangleMesh& mesh) {
    for (const auto& t : mesh.triangles)
      for (std::size_t k = 0; k < 3; ++k) {
        const int a = t[k], b = t[(k + 1) % 3];
        ends.push_back({std::min(a, b), std::max(a, b)});
      }
    std::sort(ends.begin(), ends.end());
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    for (const auto& [a, b] : ends)
      lengths.push_back((mesh.material.col(a) - mesh.material.col(b)).norm());
  }
  double mean_strain(const Points& x) const {
    double sum = 0;
    for (std::size_t i = 0; i < ends.size(); ++i)
      sum += std::abs((x.col(ends[i][0]) - x.col(ends[i][1])).norm() / lengths[i] - 1);
    return sum / static_cast<double>(ends.size());
  }
};

Points horizontal(const TriangleMesh& mesh) {
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i)
    x.col(i) << mesh.material(0, i), 1, mesh.material(1, i);
  return x;
}

/// The peer's constraints in weft.
struct EdgeCloth {
  TriangleMesh mesh;
  Edges edges;
  xpbd::System system;

  EdgeCloth(int n, int threads, double step)
      : mesh(make_swatch(kSize, kSize, n, n)), edges(mesh), system(mesh, masses(n), threads) {
    std::vector<int> ends, quads;
    std::vector<xpbd::EdgeLength::Rest<double>> lengths;
    std::vector<IsometricBend::Rest<double>> bends;
    for (std::size_t i = 0; i < edges.ends.size(); ++i) {
      ends.insert(ends.end(), edges.ends[i].begin(), edges.ends[i].end());
      lengths.push_back({edges.lengths[i], 1});
    }
    for (const Hinge& hinge : hinges(mesh)) {
      quads.insert(quads.end(), hinge.vertices.begin(), hinge.vertices.end());
      const auto p = [&](std::size_t i) -> Vec2 { return mesh.material.col(hinge.vertices[i]); };
      bends.push_back(IsometricBend::at_rest(p(0), p(1), p(2), p(3)));
    }
    system.add<xpbd::EdgeLength>(ends, lengths, xpbd::ScalarLaw(kEdgeStiffness, -1, step));
    system.add<IsometricBend>(quads, bends, xpbd::ScalarLaw(kBendStiffness, -1, step));
    system.set_positions(horizontal(mesh));
  }
  static VecX masses(int n) {
    VecX w = VecX::Ones(n * n);
    w[0] = w[n - 1] = 0;
    return w;
  }
};

/// Substeps a frame and iterations a substep; the peer's defaults, and many short ones.
struct Plan {
  int frames, substeps, iterations;
};
Plan plan_of(const benchmark::State& state) {
  return {static_cast<int>(state.range(1)), static_cast<int>(state.range(2)),
          static_cast<int>(state.range(3))};
}

void report(benchmark::State& state, const Plan& plan, std::size_t constraints, double strain) {
  const double sweeps = static_cast<double>(plan.frames * plan.substeps * plan.iterations) *
                        static_cast<double>(state.iterations());
  using benchmark::Counter;
  state.counters["iterations/s"] = Counter(sweeps, Counter::kIsRate);
  state.counters["s/constraint"] =
      Counter(sweeps * static_cast<double>(constraints), Counter::kIsRate | Counter::kInvert);
  state.counters["strain_%"] = 100 * strain;
}

void BM_WeftEdges(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Plan plan = plan_of(state);
  const double step = kFrame / plan.substeps;
  EdgeCloth cloth(n, static_cast<int>(state.range(4)), step);
  for (auto _ : state) {
    state.PauseTiming();
    cloth.system.set_positions(horizontal(cloth.mesh));
    xpbd::Motion motion(cloth.system, Vec3(0, -kGravity, 0));
    state.ResumeTiming();
    for (int frame = 0; frame < plan.frames; ++frame)
      motion.advance(step, plan.substeps, plan.iterations);
  }
  report(state, plan, cloth.system.constraint_count(),
         cloth.edges.mean_strain(cloth.system.positions()));
}

/// StVK triangles and dihedral angles: a sheet of 300 N/m and 1e-5 N m, 0.5 m wide, as it hangs.
void BM_WeftSheet(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const TriangleMesh mesh = make_swatch(0.5, 0.5, n, n);
  const OrthotropicSheet sheet{
      .c00 = 300, .c11 = 300, .c01 = 60, .c22 = 60, .bend = 1e-5, .areal_density = 0.2};
  XpbdOptions options;
  options.threads = static_cast<int>(state.range(1));
  options.bending = static_cast<XpbdBending>(state.range(2));
  const auto derivatives = state.range(3) != 0 ? xpbd::Derivatives::all : xpbd::Derivatives::none;
  xpbd::SheetSystem cloth(mesh, sheet, {0, n - 1}, options);
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i)
    x.col(i) << 0.95 * mesh.material(0, i), 0.02 * std::sin(20 * mesh.material(0, i)),
        -mesh.material(1, i);
  cloth.system().set_positions(x);
  if (derivatives == xpbd::Derivatives::all) cloth.system().start_derivatives();
  for (auto _ : state) cloth.system().sweep(derivatives);
  using benchmark::Counter;
  const double sweeps = static_cast<double>(state.iterations());
  state.counters["iterations/s"] = Counter(sweeps, Counter::kIsRate);
  state.counters["s/constraint"] =
      Counter(sweeps * static_cast<double>(cloth.system().constraint_count()),
              Counter::kIsRate | Counter::kInvert);
}

#ifdef WEFT_HAS_PBD
/// The peer's own time loop, without its iterations for velocities, which do nothing here.
void BM_Peer(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Plan plan = plan_of(state);
  omp_set_num_threads(static_cast<int>(state.range(4)));
  auto* simulation = PBD::Simulation::getCurrent();
  auto* model = new PBD::SimulationModel;
  model->init();
  simulation->setModel(model);
  model->addRegularTriangleModel(n, n, Vector3r(0, 1, 0),
                                 AngleAxisr(M_PI * 0.5, Vector3r(1, 0, 0)).matrix(),
                                 Vector2r(kSize, kSize));
  PBD::ParticleData& particles = model->getParticles();
  particles.setMass(0, 0);
  particles.setMass(static_cast<unsigned>(n - 1), 0);
  PBD::TriangleModel* sheet = model->getTriangleModels()[0];
  model->addClothConstraints(sheet, 4, kEdgeStiffness, 1, 1, 1, 0.3, 0.3, false, false);
  model->addBendingConstraints(sheet, 3, kBendStiffness);
  auto* stepper = static_cast<PBD::TimeStepController*>(simulation->getTimeStep());
  using Stepper = PBD::TimeStepController;
  stepper->setValue<unsigned>(Stepper::NUM_SUB_STEPS, static_cast<unsigned>(plan.substeps));
  stepper->setValue<unsigned>(Stepper::MAX_ITERATIONS, static_cast<unsigned>(plan.iterations));
  stepper->setValue<unsigned>(Stepper::MAX_ITERATIONS_V, 0);
  PBD::TimeManager::getCurrent()->setTimeStepSize(kFrame);
  model->initConstraintGroups();
  std::size_t vertices = particles.size();
  for (auto _ : state) {
    state.PauseTiming();
    for (unsigned i = 0; i < vertices; ++i) {
      particles.setPosition(i, particles.getPosition0(i));
      particles.setLastPosition(i, particles.getPosition0(i));
      particles.setOldPosition(i, particles.getPosition0(i));
      particles.getVelocity(i).setZero();
    }
    state.ResumeTiming();
    for (int frame = 0; frame < plan.frames; ++frame) stepper->step(*model);
  }
  const TriangleMesh mesh = make_swatch(kSize, kSize, n, n);
  Points x(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i)
    x.col(i) = particles.getPosition(static_cast<unsigned>(i));
  report(state, plan, model->getConstraints().size(), Edges(mesh).mean_strain(x));
  delete model;
  simulation->setModel(nullptr);
}
#endif

/// Fewer frames on the larger meshes. On one core by the time of the processor, which others on the
/// machine disturb less; on two by the clock.
void plan_runs(benchmark::internal::Benchmark* b, int threads) {
  for (const auto& [n, frames] : {std::pair{25, 400}, {100, 60}, {200, 10}})
    for (const auto& [substeps, iterations] : {std::pair{5, 10}, {50, 1}})
      b->Args({n, frames, substeps, iterations, threads});
  b->ArgNames({"vertices", "frames", "substeps", "iterations", "threads"});
  b->Unit(benchmark::kMillisecond);
  if (threads > 1) b->UseRealTime();
}
void one_core(benchmark::internal::Benchmark* b) { plan_runs(b, 1); }
void two_cores(benchmark::internal::Benchmark* b) { plan_runs(b, 2); }

#ifdef WEFT_HAS_PBD
BENCHMARK(BM_Peer)->Apply(one_core);
#endif
BENCHMARK(BM_WeftEdges)->Apply(one_core);
#ifdef WEFT_HAS_PBD
BENCHMARK(BM_Peer)->Apply(two_cores);
#endif
BENCHMARK(BM_WeftEdges)->Apply(two_cores);

void sheets(benchmark::internal::Benchmark* b, int threads) {
  for (const std::int64_t n : {25, 100, 200}) b->Args({n, threads, 0, 0});
  if (threads == 1)
    for (const std::int64_t n : {25, 100})
      for (const auto& [bending, derivatives] : {std::pair{2, 0}, {0, 1}, {2, 1}})
        b->Args({n, 1, bending, derivatives});
  b->ArgNames({"vertices", "threads", "bending", "derivatives"});
  b->Unit(benchmark::kMicrosecond);
  if (threads > 1) b->UseRealTime();
}
void sheets_one_core(benchmark::internal::Benchmark* b) { sheets(b, 1); }
void sheets_two_cores(benchmark::internal::Benchmark* b) { sheets(b, 2); }
BENCHMARK(BM_WeftSheet)->Apply(sheets_one_core);
BENCHMARK(BM_WeftSheet)->Apply(sheets_two_cores);

}  // namespace
}  // namespace weft

BENCHMARK_MAIN();
