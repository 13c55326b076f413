#include <algorithm>
#include <cmath>
#include <cstdio>

#include "dynamics/scenes.h"
#include "study.h"
#include "weft/report/figures.h"
#include "weft/report/text.h"

namespace weft::validation {
namespace {

using namespace weft::test;

constexpr double kSide = 0.5;  // m
constexpr int kSizes[] = {13, 25, 49, 97};
constexpr int kFinest = 97;

/// How the swatch hangs.
enum class Holding {
  /// By its two upper corner vertices. A force F at a point of an elastic sheet has no finite
  /// displacement: the strain falls as 1 / r, so that each halving of the mesh width lets a corner
  /// give way by about F ln 2 / (k (pi / 4 + 1 / 2)) more (a force along the bisector of a wedge of
  /// 90 degrees, k the stretch stiffness). With the swatch below that is 0.7 mm, which no mesh
  /// makes smaller.
  corners,
  edge  ///< by its whole upper edge, on a wave: no such point
};

const char* name_of(Holding holding) {
  return holding == Holding::corners ? "two corners" : "upper edge";
}

/// The upper edge's point at u: a wave whose tangent turns by up to 1 rad, without stretch.
Vec3 on_wave(double u) {
  constexpr int kSamples = 400;
  Vec3 at(-0.5 * kSide, 0, 1);
  const double h = u / kSamples;
  for (int i = 0; i < kSamples; ++i) {
    const double angle = std::sin(3 * M_PI * (i + 0.5) * h / kSide);
    at += h * Vec3(std::cos(angle), std::sin(angle), 0);
  }
  return at;
}

Points start_on(const TriangleMesh& mesh, Holding holding) {
  if (holding == Holding::corners) return sagging_start(mesh);
  return place(mesh, [](double u, double v) -> Vec3 { return on_wave(u) - Vec3(0, 0, v); });
}

std::vector<PointFixture> fixtures_of(const TriangleMesh& mesh, int n, Holding holding) {
  const Points start = start_on(mesh, holding);
  if (holding == Holding::corners) {
    return {{"left", 0, Motion::fixed({-0.1875, 0, 1})},
            {"right", n - 1, Motion::fixed({0.1875, 0, 1})}};
  }
  std::vector<PointFixture> fixtures;
  for (int i = 0; i < n; ++i) fixtures.push_back(hold(i, start));
  return fixtures;
}

TriangleMesh swatch(int n) { return make_swatch(kSide, kSide, n, n); }

StaticResult relax(int n, double bend, Holding holding, const Points& start) {
  const TriangleMesh mesh = swatch(n);
  const ClothModel model(mesh, make_fabric({.stretch = 300, .shear = 100, .bend = bend}), 0.3,
                         Vec3(0, 0, -kGravity));
  return solve_static(model, start, fixtures_of(mesh, n, holding), 0);
}

/// The surface `x` of the swatch of n x n vertices at the vertices of another mesh of it.
Points transfer(const Points& x, int n, const TriangleMesh& to) {
  const TriangleMesh from = swatch(n);
  return interpolate(from, MaterialLocator(from), x, to.material);
}

/// Distances at the material points of the coarsest mesh, which all meshes have.
VecX distances(const Points& a, int n_a, const Points& b, int n_b) {
  const auto pick = [](const Points& x, int n) {
    const int stride = (n - 1) / 12;
    Points common(3, 169);
    for (int i = 0; i < 169; ++i) common.col(i) = x.col((i / 13) * stride * n + (i % 13) * stride);
    return common;
  };
  return (pick(a, n_a) - pick(b, n_b)).colwise().norm();
}

struct Shape {
  int n = 0;
  StaticResult result;
};

/// An equilibrium on each mesh, all on one branch: found on the coarsest mesh, refined mesh by mesh
/// to the finest, and relaxed from the finest one's shape on each of the others. (From one smooth
/// guess limp cloth ends on another of its many equilibria on each mesh.)
std::vector<Shape> one_branch(double bend, Holding holding) {
  Points x = start_on(swatch(kSizes[0]), holding);
  int last = kSizes[0];
  for (const int n : kSizes) {
    x = relax(n, bend, holding, transfer(x, last, swatch(n))).x;
    last = n;
  }
  std::vector<Shape> shapes;
  for (const int n : kSizes) {
    shapes.push_back({n, relax(n, bend, holding, transfer(x, kFinest, swatch(n)))});
  }
  return shapes;
}

}  // namespace

void study_mesh(const std::filesystem::path& out, Findings& findings) {
  Csv csv(out / "mesh_pairs.csv",
          "held by,bend_stiffness_N_m,vertices a side,against,mean_m,max_m,converged");
  std::vector<PlotSeries> all;
  std::puts("static shape by mesh: mean (largest) distance between meshes, mm");
  for (const Holding holding : {Holding::corners, Holding::edge}) {
    for (const double bend : {1e-3, 1e-4, 1e-5}) {
      const std::vector<Shape> shapes = one_branch(bend, holding);
      PlotSeries& series = all.emplace_back();
      series.name = fmt::format("{}, {} N·m", name_of(holding), format_short(bend));
      series.dashed = holding == Holding::corners;
      std::string line = fmt::format("  held by {}, bend {:.0e} N m:", name_of(holding), bend);
      std::vector<double> next;  // mm, each mesh against the next finer one
      for (std::size_t a = 0; a < shapes.size(); ++a) {
        if (!shapes[a].result.converged) line += fmt::format("  {}^2 NOT CONVERGED", shapes[a].n);
        for (std::size_t b = a + 1; b < shapes.size(); ++b) {
          const VecX apart =
              distances(shapes[a].result.x, shapes[a].n, shapes[b].result.x, shapes[b].n);
          csv.row("{},{},{},{},{:.6e},{:.6e},{}", name_of(holding), bend, shapes[a].n, shapes[b].n,
                  apart.mean(), apart.maxCoeff(),
                  shapes[a].result.converged && shapes[b].result.converged);
          line += fmt::format("  {}-{} {:.3f} ({:.3f})", shapes[a].n, shapes[b].n,
                              1e3 * apart.mean(), 1e3 * apart.maxCoeff());
          if (b != a + 1) continue;
          next.push_back(1e3 * apart.mean());
          series.x.push_back(1e3 * kSide / (shapes[a].n - 1));
          series.y.push_back(next.back());
        }
      }
      std::puts(line.c_str());
      findings.push_back({fmt::format("static shape, held by {}, bend {} N m: 13-25, 25-49, 49-97",
                                      name_of(holding), bend),
                          fmt::format("{:.2f}, {:.2f}, {:.2f} mm", next[0], next[1], next[2]),
                          "shrinks with the mesh", next[0] > next[1] && next[1] > next[2]});
    }
  }
  PlotAxis size, error;
  size.label = "mesh width";
  size.unit = "mm";
  size.lower = 9;
  size.upper = 52;
  error.label = "mean distance to the static shape at half the mesh width";
  error.unit = "mm";
  write_plot(out / "mesh.svg",
             convergence_plot("Static shape of a hanging swatch by mesh", size, error, all, {2}));
}

}  // namespace weft::validation
