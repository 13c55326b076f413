#include "weft/estimate/scan_synthetic.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <set>
#include <utility>

#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/dynamics/clips.h"
#include "weft/model/bending.h"

namespace weft {
namespace {

constexpr double kBarStiffness = 1e5;  // N/m, of a spring between two vertices of a free bar
constexpr double kGravityOfWeights = 9.81;

/// Heavy cloth with forces on vertices and springs that make free bars rigid.
class PulledCloth final : public StaticPotential {
 public:
  struct Spring {
    int a, b;
    double length;
  };
  PulledCloth(const HeavyCloth& cloth, Points pulls, std::vector<Spring> springs)
      : cloth_(cloth), pulls_(std::move(pulls)), springs_(std::move(springs)) {}

  double value(const Points& x) const override {
    double energy = cloth_.value(x) - pulls_.cwiseProduct(x).sum();
    for (const Spring& s : springs_) {
      const double stretch = (x.col(s.b) - x.col(s.a)).norm() - s.length;
      energy += 0.5 * kBarStiffness * stretch * stretch;
    }
    return energy;
  }
  void gradient(const Points& x, Points& gradient) const override {
    cloth_.gradient(x, gradient);
    add_pulls_and_springs(x, gradient);
  }
  void hessian(const Points& x, HessianKind kind, Points& gradient,
               SparseMatrix& hessian) const override {
    cloth_.hessian(x, kind, gradient, hessian);
    add_pulls_and_springs(x, gradient);
    for (const Spring& s : springs_) {
      const Vec3 d = x.col(s.b) - x.col(s.a);
      const double length = d.norm();
      const Vec3 n = d / length;
      double across = kBarStiffness * (1 - s.length / length);
      if (kind == HessianKind::positive_semidefinite) across = std::max(across, 0.0);
      const Mat3 block =
          kBarStiffness * n * n.transpose() + across * (Mat3::Identity() - n * n.transpose());
      add_block(s.a, s.a, block, hessian);
      add_block(s.b, s.b, block, hessian);
      add_block(std::max(s.a, s.b), std::min(s.a, s.b), -block, hessian);
    }
  }
  const SparseMatrix& hessian_pattern() const override { return cloth_.hessian_pattern(); }
  const VecX& masses() const override { return cloth_.masses(); }
  const TriangleMesh& mesh() const override { return cloth_.mesh(); }

 private:
  void add_pulls_and_springs(const Points& x, Points& gradient) const {
    gradient -= pulls_;
    for (const Spring& s : springs_) {
      const Vec3 d = x.col(s.b) - x.col(s.a);
      const double length = d.norm();
      const Vec3 force = kBarStiffness * (1 - s.length / length) * d;
      gradient.col(s.b) += force;
      gradient.col(s.a) -= force;
    }
  }
  static void add_block(int row, int column, const Mat3& block, SparseMatrix& hessian) {
    [[maybe_unused]] const Eigen::Index before = hessian.nonZeros();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        if (3 * row + i >= 3 * column + j)
          hessian.coeffRef(3 * row + i, 3 * column + j) += block(i, j);
    assert(hessian.nonZeros() == before);
  }

  const HeavyCloth& cloth_;
  Points pulls_;
  std::vector<Spring> springs_;
};

/// All pairs of the bar's vertices that a bending element couples, which the Hessian has places
/// for: as rigid as a truss of those.
void add_springs(const TriangleMesh& mesh, const std::vector<int>& clamp_of, int clamp,
                 std::vector<PulledCloth::Spring>& springs) {
  std::set<std::pair<int, int>> pairs;
  const auto add = [&](int a, int b) {
    if (clamp_of[at(a)] == clamp && clamp_of[at(b)] == clamp)
      pairs.insert({std::min(a, b), std::max(a, b)});
  };
  for (const BendingElement& element : bending_elements(mesh))
    for (std::size_t i = 0; i < 6; ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (element.vertices[i] != element.vertices[j])
          add(element.vertices[i], element.vertices[j]);
  for (const auto& [a, b] : pairs)
    springs.push_back({a, b, (mesh.material.col(a) - mesh.material.col(b)).norm()});
}

ExperimentClamp clamp_at(std::string name, ClampKind kind, const Vec2& lower, const Vec2& upper) {
  ExperimentClamp clamp;
  clamp.clamp.name = std::move(name);
  clamp.clamp.kind = kind;
  clamp.clamp.region = {lower, upper};
  return clamp;
}

}  // namespace

ScanExperiment picture_frame(double width, double height, double shear, double perturbation) {
  ScanExperiment e;
  e.name = fmt::format("frame {:g} degrees", shear * 180 / 3.14159265358979);
  e.perturbation = perturbation;
  const double s = std::sin(shear), c = std::cos(shear);
  e.start = [s, c](const Vec2& uv) { return Vec3(uv.x() + s * uv.y(), c * uv.y(), 0); };
  e.clamps = {clamp_at("bottom", ClampKind::bar, {0, 0}, {width, 0}),
              clamp_at("top", ClampKind::bar, {0, height}, {width, height}),
              clamp_at("left", ClampKind::bar, {0, 0}, {0, height}),
              clamp_at("right", ClampKind::bar, {width, 0}, {width, height})};
  for (ExperimentClamp& clamp : e.clamps) clamp.place = e.start;
  return e;
}

ScanExperiment edge_stretch(double width, double height, ScanAxis axis, double strain,
                            double perturbation) {
  ScanExperiment e;
  const bool along_u = axis == ScanAxis::u;
  e.name = fmt::format("stretch {} {:g}", along_u ? "u" : "v", strain);
  e.perturbation = perturbation;
  e.start = [strain, along_u](const Vec2& uv) {
    return Vec3(uv.x() * (along_u ? 1 + strain : 1), uv.y() * (along_u ? 1 : 1 + strain), 0);
  };
  if (along_u)
    e.clamps = {clamp_at("left", ClampKind::bar, {0, 0}, {0, height}),
                clamp_at("right", ClampKind::bar, {width, 0}, {width, height})};
  else
    e.clamps = {clamp_at("bottom", ClampKind::bar, {0, 0}, {width, 0}),
                clamp_at("top", ClampKind::bar, {0, height}, {width, height})};
  // An edge that is clamped keeps its length.
  for (ExperimentClamp& clamp : e.clamps) clamp.place = e.start;
  return e;
}

ScanExperiment corner_weights(double width, double height, double separation, double left,
                              double right) {
  ScanExperiment e;
  e.name = fmt::format("corners {:g} g, {:g} g", 1e3 * left, 1e3 * right);
  e.perturbation = 1e-4;
  const double middle = 0.5 * width;
  e.start = [separation, middle](const Vec2& uv) {
    return Vec3(middle + separation * (uv.x() - middle), 0, -uv.y());
  };
  e.clamps = {clamp_at("top left", ClampKind::points, {0, 0}, {0, 0}),
              clamp_at("top right", ClampKind::points, {width, 0}, {width, 0}),
              clamp_at("bottom left", ClampKind::points, {0, height}, {0, height}),
              clamp_at("bottom right", ClampKind::points, {width, height}, {width, height})};
  e.clamps[0].place = e.clamps[1].place = e.start;
  e.clamps[2].pull = Vec3(0, 0, -kGravityOfWeights * left);
  e.clamps[3].pull = Vec3(0, 0, -kGravityOfWeights * right);
  return e;
}

ScanExperiment edge_weight(double width, double height, ScanAxis axis, double depth,
                           double weight) {
  ScanExperiment e;
  const bool along_u = axis == ScanAxis::u;
  e.name = fmt::format("edge {:g} g along {}", 1e3 * weight, along_u ? "u" : "v");
  e.perturbation = 1e-4;
  e.start = [along_u](const Vec2& uv) {
    return along_u ? Vec3(uv.y(), 0, -uv.x()) : Vec3(uv.x(), 0, -uv.y());
  };
  if (along_u)
    e.clamps = {clamp_at("top", ClampKind::bar, {0, 0}, {depth, height}),
                clamp_at("weight", ClampKind::bar, {width - depth, 0}, {width, height})};
  else
    e.clamps = {clamp_at("top", ClampKind::bar, {0, 0}, {width, depth}),
                clamp_at("weight", ClampKind::bar, {0, height - depth}, {width, height})};
  e.clamps[0].place = e.start;
  e.clamps[1].pull = Vec3(0, 0, -kGravityOfWeights * weight);
  return e;
}

ScanExperiment ledge(double width, double height, ScanAxis axis, double support) {
  ScanExperiment e;
  const bool along_u = axis == ScanAxis::u;
  e.name = fmt::format("ledge along {}", along_u ? "u" : "v");
  e.perturbation = 1e-5;
  e.start = [](const Vec2& uv) { return Vec3(uv.x(), uv.y(), 0); };
  e.clamps = {clamp_at("table", ClampKind::bar, {0, 0},
                       along_u ? Vec2(support, height) : Vec2(width, support))};
  e.clamps[0].place = e.start;
  return e;
}

SynthesizedScan synthesize_scan(const ScanExperiment& experiment, const TriangleMesh& mesh,
                                const Fabric& fabric, const ScanSynthesis& options) {
  const int vertices = mesh.vertex_count();
  std::vector<int> clamp_of(at(vertices), -1);
  std::vector<char> held(at(vertices), 0);
  Points x(3, vertices), pulls = Points::Zero(3, vertices);
  Rng rng(options.seed);
  for (int i = 0; i < vertices; ++i) {
    x.col(i) = experiment.start(mesh.material.col(i));
    for (int k = 0; k < 3; ++k) x(k, i) += experiment.perturbation * rng.normal();
  }
  std::vector<PulledCloth::Spring> springs;
  for (std::size_t c = 0; c < experiment.clamps.size(); ++c) {
    const ExperimentClamp& clamp = experiment.clamps[c];
    std::vector<int> own;
    for (int i = 0; i < vertices; ++i) {
      if (clamp_of[at(i)] >= 0 || !clamp.clamp.region.contains(mesh.material.col(i))) continue;
      clamp_of[at(i)] = static_cast<int>(c);
      own.push_back(i);
    }
    if (own.empty())
      throw Error(fmt::format("experiment \"{}\": clamp \"{}\" holds no vertex", experiment.name,
                              clamp.clamp.name));
    for (const int i : own) {
      if (clamp.place) {
        held[at(i)] = 1;
        x.col(i) = clamp.place(mesh.material.col(i));
      } else {
        x.col(i) = experiment.start(mesh.material.col(i));
        pulls.col(i) = clamp.pull / static_cast<double>(own.size());
      }
    }
    if (!clamp.place && clamp.clamp.kind == ClampKind::bar)
      add_springs(mesh, clamp_of, static_cast<int>(c), springs);
  }

  const auto model = make_elastic_model(mesh, fabric);
  const HeavyCloth heavy(*model, options.areal_density, experiment.gravity);
  const PulledCloth cloth(heavy, pulls, springs);
  const StaticResult found = solve_static(cloth, x, held, options.statics);

  SynthesizedScan result;
  result.converged = found.converged;
  result.residual = found.residual;
  result.exact = found.x;
  result.shape.mesh = mesh;
  result.shape.x = found.x;
  result.shape.weights = VecX::Ones(vertices);
  for (double& coordinate : result.shape.x.reshaped()) coordinate += options.noise * rng.normal();
  Points gradient;
  heavy.gradient(found.x, gradient);
  result.target.name = experiment.name;
  result.target.gravity = experiment.gravity;
  result.target.noise = options.stated_noise;
  for (std::size_t c = 0; c < experiment.clamps.size(); ++c) {
    const ExperimentClamp& from = experiment.clamps[c];
    ScanClamp clamp = from.clamp;
    Vec3 force = from.pull;
    if (from.place) {
      force.setZero();
      for (int i = 0; i < vertices; ++i)
        if (clamp_of[at(i)] == static_cast<int>(c)) force += gradient.col(i);
    }
    clamp.force = std::max(force.norm() + options.force_noise * rng.normal(), 0.0);
    clamp.force_noise = options.stated_force_noise;
    result.target.clamps.push_back(std::move(clamp));
  }
  return result;
}

}  // namespace weft
