// XPBD against Newton's method and closed forms: stiffness by the number of sweeps, equilibria and
// their derivatives with the time they take, and what the kinds of bending are on random meshes.
#include <fmt/format.h>

#include <ctime>

#include "dynamics/random_strip.h"
#include "weft/dynamics/clips.h"
#include "weft/dynamics/sparse_cholesky.h"
#include "weft/strain/dihedral_angle.h"

namespace weft::validation {
namespace {

using namespace weft::test;

double processor_seconds() {
  return static_cast<double>(std::clock()) / static_cast<double>(CLOCKS_PER_SEC);
}

void study_multipliers() {
  fmt::print(
      "A strip of 300 N/m, 0.5 m long, hanging by its own weight: elongation over the closed "
      "form, step 1 ms\n\n| sweeps a step | kept | from zero |\n|---|---|---|\n");
  const TriangleMesh mesh = make_swatch(0.05, 0.5, 3, 21, GridPattern::uniform);
  const Points start = place(mesh, [](double u, double v) { return Vec3(u, 0, -v); });
  const OrthotropicSheet sheet{
      .c00 = 300, .c11 = 300, .c01 = 0, .c22 = 100, .bend = 1e-5, .areal_density = 0.2};
  const double expected = 0.2 * kGravity * 0.5 * 0.5 / (2 * 300);
  for (const int sweeps : {1, 2, 4, 8, 32}) {
    fmt::print("| {} |", sweeps);
    for (const auto kind : {XpbdMultipliers::kept, XpbdMultipliers::from_zero}) {
      XpbdOptions options;
      options.multipliers = kind;
      options.sweeps_per_step = sweeps;
      options.time_step = 1e-3;
      options.max_iterations = 3000 * sweeps;
      const auto result = xpbd_equilibrium(mesh, sheet, {0, 1, 2}, start, options);
      fmt::print(" {:.4f} |", (-result.x.row(2).tail(3).mean() - 0.5) / expected);
    }
    fmt::print("\n");
  }
}

/// A cotton-like sheet of 0.15 m x 0.15 m, in three experiments.
struct Experiment {
  const char* name;
  TriangleMesh mesh;
  Vec3 gravity{0, 0, -kGravity};
  std::vector<int> pinned;
  Points start;
};
constexpr double kSide = 0.15;
const OrthotropicSheet kCotton{
    .c00 = 181, .c11 = 507, .c01 = 203, .c22 = 40, .bend = 5e-6, .areal_density = 0.224};

Experiment sheared_frame(int n) {
  Experiment e{"sheared frame", make_swatch(kSide, kSide, n, n), Vec3::Zero(), {}, {}};
  e.start = place(e.mesh, [](double u, double v) {
    return Vec3(u + std::sin(0.26) * v, v * std::cos(0.26), 0);
  });
  Rng rng(3);
  for (int i = 0; i < n * n; ++i) {
    const int row = i / n, column = i % n;
    if (row == 0 || column == 0 || row == n - 1 || column == n - 1)
      e.pinned.push_back(i);
    else
      e.start(2, i) += 5e-4 * rng.normal();
  }
  return e;
}
Experiment ledge(int n) {
  Experiment e{"over a ledge", make_swatch(kSide, kSide, n, n), {0, 0, -kGravity}, {}, {}};
  e.start = place(e.mesh, [](double u, double v) { return Vec3(u, v, 0); });
  for (int i = 0; i < n * (n / 3); ++i) e.pinned.push_back(i);
  return e;
}
Experiment two_corners(int n) {
  Experiment e{"two corners", make_swatch(kSide, kSide, n, n), {0, 0, -kGravity}, {0, n - 1}, {}};
  const TriangleMesh large = make_swatch(0.5, 0.5, n, n);
  e.start = kSide / 0.5 * sagging_start(large);
  return e;
}

std::unique_ptr<ElasticModel> model_of(const TriangleMesh& mesh) {
  Fabric fabric = Fabric::with_defaults("cotton", "stvk");
  const double b = kCotton.bend;
  fabric.values.head(8) << kCotton.c00, kCotton.c01, kCotton.c11, kCotton.c22, b, 0, b, b / 2;
  return make_elastic_model(mesh, fabric);
}

/// By the implicit function theorem, 3 n x 5.
MatX exact_derivative(const HeavyCloth& cloth, const std::vector<char>& held, const Points& x) {
  SparseMatrix hessian = cloth.hessian_pattern();
  hessian.coeffs().setZero();
  Points gradient;
  cloth.hessian(x, HessianKind::exact, gradient, hessian);
  SparseCholesky<double> cholesky(hessian, held, cloth.mesh().material);
  MatX own;
  cloth.model().parameter_derivative(x, own);
  MatX right(own.rows(), kSheetParameters);
  right << own.col(0), own.col(2), own.col(1), own.col(3),
      own.col(4) + own.col(6) + 0.5 * own.col(7);
  if (!cholesky.factorize(hessian))
    return MatX::Constant(own.rows(), kSheetParameters, std::nan(""));
  for (int p = 0; p < kSheetParameters; ++p) {
    Points column = -Eigen::Map<const Points>(right.col(p).data(), 3, x.cols());
    cholesky.solve(column);
    right.col(p) = flat(column);
  }
  return right;
}

void compare(const Experiment& e, XpbdSweep sweep) {
  const auto model = model_of(e.mesh);
  const HeavyCloth cloth(*model, kCotton.areal_density, e.gravity);
  std::vector<char> held(static_cast<std::size_t>(e.mesh.vertex_count()), 0);
  for (const int i : e.pinned) held[static_cast<std::size_t>(i)] = 1;
  double time = processor_seconds();
  const StaticResult newton = solve_static(cloth, e.start, held);
  const double newton_time = processor_seconds() - time;

  XpbdOptions options;
  options.gravity = e.gravity;
  options.bending = XpbdBending::curvature;
  options.sweep = sweep;
  time = processor_seconds();
  const XpbdEquilibrium x = xpbd_equilibrium(e.mesh, kCotton, e.pinned, e.start, options);
  const double xpbd_time = processor_seconds() - time;
  options.derivatives = XpbdDerivatives::at_rest;
  options.derivative_tolerance = 1e-4;
  time = processor_seconds();
  const XpbdEquilibrium d = xpbd_equilibrium(e.mesh, kCotton, e.pinned, x.x, options);
  const double derivative_time = processor_seconds() - time;

  // The equilibrium next to XPBD's, which need not be the one that Newton's method found.
  const StaticResult next = solve_static(cloth, x.x, held, {.force_tolerance = 1e-10});
  time = processor_seconds();
  const MatX exact = exact_derivative(cloth, held, next.x);
  const double exact_time = processor_seconds() - time;
  double worst = 0;
  for (int p = 0; p < kSheetParameters; ++p)
    worst =
        std::max(worst, (d.position_derivative.col(p) - exact.col(p)).norm() / exact.col(p).norm());
  fmt::print(
      "| {}, {} vertices{} | {} | {:.2f} | {:.2f} | {:.1e} | {:.1e} | {} | {:.2f} | {:.3f} | "
      "{:.1e} |\n",
      e.name, e.mesh.vertex_count(), sweep == XpbdSweep::jacobi ? ", Jacobi" : "",
      x.converged ? std::to_string(x.iterations) : "not at rest", xpbd_time, newton_time,
      1e3 * largest_distance(x.x, next.x), 1e3 * largest_distance(x.x, newton.x),
      d.converged ? std::to_string(d.iterations) : "not at rest", derivative_time, exact_time,
      worst);
}

void study_equilibria() {
  fmt::print(
      "\nXPBD against Newton's method, net force below 1e-8 N; times are of one processor, s; "
      "distances the largest of a vertex, mm\n\n| scene | sweeps | XPBD | Newton | to the "
      "equilibrium next to it | to Newton's | sweeps for derivatives | XPBD | exact | relative "
      "difference |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const int n : {13, 25, 41}) {
    compare(sheared_frame(n), XpbdSweep::gauss_seidel);
    compare(ledge(n), XpbdSweep::gauss_seidel);
    compare(two_corners(n), XpbdSweep::gauss_seidel);
  }
  compare(sheared_frame(25), XpbdSweep::jacobi);
}

/// Energy of the hinges over that of a plate of rigidity b, with the vertices on a cylinder of
/// small curvature that is bent along the direction at `angle` from u. Not at equilibrium.
double cylinder_energy(const TriangleMesh& mesh, XpbdBending bending, double angle) {
  const double curvature = 0.1;
  const Points x = place(mesh, [&](double u, double v) {
    const double along = u * std::cos(angle) + v * std::sin(angle);
    return Vec3(u, v, 0.5 * curvature * along * along);
  });
  double sum = 0, area = 0;
  for (const Hinge& h : hinges(mesh)) {
    const auto at = [&](std::size_t i) -> Vec3 { return x.col(h.vertices[i]); };
    const auto uv = [&](std::size_t i) -> Vec2 { return mesh.material.col(h.vertices[i]); };
    const double theta = dihedral_angle_strain(at(0), at(1), at(2), at(3)).value;
    const auto twice_area = [&](std::size_t apex) {
      const Vec2 e = uv(1) - uv(0), s = uv(apex) - uv(0);
      return std::abs(e.x() * s.y() - e.y() * s.x());
    };
    const double weight = bending == XpbdBending::weighted_dihedral
                              ? 2 * (uv(1) - uv(0)).squaredNorm() / (twice_area(2) + twice_area(3))
                              : 1;
    sum += 0.5 * weight * theta * theta;
  }
  for (int t = 0; t < mesh.triangle_count(); ++t) area += material_area(mesh, t);
  return sum / (0.5 * curvature * curvature * area);
}

void study_bending() {
  fmt::print(
      "\nTip of a heavy cantilever, rho g L^3 / b = 5: off from the elastica, %\n\n| cells | "
      "mesh | one b an edge | weighted | curvature |\n|---|---|---|---|---|\n");
  for (const int cells : {10, 20, 40})
    for (const int seed : {-1, 0, 1, 2, 3}) {
      const RandomStrip strip(cells, seed,
                              seed < 0 ? GridPattern::uniform : GridPattern::alternating);
      fmt::print(
          "| {} | {} |", cells,
          seed < 0 ? "uniform" : (seed == 0 ? "alternating" : fmt::format("random {}", seed)));
      for (const auto bending :
           {XpbdBending::dihedral, XpbdBending::weighted_dihedral, XpbdBending::curvature})
        fmt::print(" {:+.1f} |", 100 * strip.tip_error(bending));
      fmt::print("\n");
    }
  fmt::print(
      "\nEnergy of a cylinder over that of a plate, before the vertices give way, by the angle "
      "of its bend from u\n\n| mesh, 40 x 40 cells | one b an edge: 0, 45, 90, 135 degrees | "
      "weighted |\n|---|---|---|\n");
  constexpr int kVertices = 41;
  for (const int seed : {-1, 0, 1, 2}) {
    TriangleMesh mesh = make_swatch(1, 1, kVertices, kVertices,
                                    seed < 0 ? GridPattern::uniform : GridPattern::alternating);
    if (seed > 0) mesh = shuffled(mesh, kVertices, kVertices, 1, seed);
    fmt::print("| {} |",
               seed < 0 ? "uniform" : (seed == 0 ? "alternating" : fmt::format("random {}", seed)));
    for (const auto bending : {XpbdBending::dihedral, XpbdBending::weighted_dihedral}) {
      for (const int degrees : {0, 45, 90, 135})
        fmt::print(" {:.2f}", cylinder_energy(mesh, bending, degrees * M_PI / 180));
      fmt::print(" |");
    }
    fmt::print("\n");
  }
}

}  // namespace
}  // namespace weft::validation

int main() {
  weft::validation::study_multipliers();
  weft::validation::study_equilibria();
  weft::validation::study_bending();
}
