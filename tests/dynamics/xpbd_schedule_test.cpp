#include "weft/dynamics/xpbd_schedule.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "weft/dynamics/xpbd_system.h"

namespace weft::xpbd::xpbd_schedule_test {
namespace {

std::vector<int> triangle_stencils(const TriangleMesh& mesh, const SlabOrder& order) {
  std::vector<int> out;
  for (const auto& t : mesh.triangles)
    for (const int i : t) out.push_back(order.index[static_cast<std::size_t>(i)]);
  return out;
}
std::vector<int> hinge_stencils(const TriangleMesh& mesh, const SlabOrder& order) {
  std::vector<int> out;
  for (const Hinge& h : hinges(mesh))
    for (const int i : h.vertices) out.push_back(order.index[static_cast<std::size_t>(i)]);
  return out;
}

TEST(XpbdColours, NoTwoOfAColourShareAVertex) {
  const std::vector<int> edges{0, 1, 1, 2, 2, 0, 3, 4, 4, 0, 2, 3};
  const std::vector<int> colour = colours(edges, 2, 5);
  ASSERT_EQ(colour.size(), 6U);
  for (std::size_t a = 0; a < 6; ++a)
    for (std::size_t b = 0; b < a; ++b) {
      const bool share = edges[2 * a] == edges[2 * b] || edges[2 * a] == edges[2 * b + 1] ||
                         edges[2 * a + 1] == edges[2 * b] || edges[2 * a + 1] == edges[2 * b + 1];
      EXPECT_TRUE(!share || colour[a] != colour[b]) << a << " and " << b;
    }
}

TEST(XpbdSchedule, EachConstraintOnceAndTasksApart) {
  for (const int per_slab : {7, 40, 100, 5000}) {
    const TriangleMesh mesh = make_swatch(0.3, 0.5, 13, 21);
    const SlabOrder order = slab_order(mesh, per_slab);
    Scheduler scheduler(order);
    constexpr int kPack = 8;
    std::array<std::map<int, std::set<std::size_t>>, 3> tasks_of_vertex;
    for (const int width : {3, 4}) {
      const auto stencils =
          width == 3 ? triangle_stencils(mesh, order) : hinge_stencils(mesh, order);
      const Schedule schedule = scheduler.add(stencils, width, kPack);
      std::multiset<int> seen;
      for (std::size_t phase = 0; phase < 3; ++phase)
        for (std::size_t task = 0; task < schedule.tasks[phase].size(); ++task) {
          const TaskRange range = schedule.tasks[phase][task];
          EXPECT_EQ(range.begin % kPack, 0U);
          std::set<int> pack;
          for (std::size_t i = range.begin; i < range.end; ++i) {
            if (i % kPack == 0) pack.clear();
            const int c = schedule.order[i];
            if (c < 0) continue;
            seen.insert(c);
            for (int k = 0; k < width; ++k) {
              const int vertex = stencils[static_cast<std::size_t>(width * c + k)];
              EXPECT_TRUE(pack.insert(vertex).second) << "a pack has vertex " << vertex << " twice";
              tasks_of_vertex[phase][vertex].insert(task);
            }
          }
        }
      EXPECT_EQ(seen.size(), stencils.size() / static_cast<std::size_t>(width));
      EXPECT_EQ(std::set<int>(seen.begin(), seen.end()).size(), seen.size());
    }
    for (const auto& phase : tasks_of_vertex)
      for (const auto& [vertex, tasks] : phase)
        EXPECT_EQ(tasks.size(), 1U) << "vertex " << vertex << ", " << per_slab << " a slab";
  }
}

TEST(XpbdSystem, SweepsDoNotDependOnTheNumberOfThreads) {
  const TriangleMesh mesh = make_swatch(0.3, 0.5, 13, 21);
  const OrthotropicSheet sheet{.c00 = 300, .c11 = 200, .c01 = 60, .c22 = 50, .bend = 1e-4};
  Points start(3, mesh.vertex_count());
  for (int i = 0; i < mesh.vertex_count(); ++i) {
    const Vec2 p = mesh.material.col(i);
    start.col(i) << 1.1 * p.x(), p.y() - 0.4 * p.x() * p.y(), 0.1 * std::sin(20 * p.y());
  }
  for (const XpbdSweep kind : {XpbdSweep::gauss_seidel, XpbdSweep::jacobi}) {
    const auto swept = [&](int threads) {
      System system(mesh, VecX::Constant(mesh.vertex_count(), 1e4), threads, 40);
      EXPECT_GT(system.order().slab_count(), 3);
      std::vector<int> triangles, edges;
      std::vector<GreenTriangle::Rest<double>> shapes;
      std::vector<DihedralHinge::Rest<double>> flat_hinges;
      for (const auto& t : mesh.triangles) {
        triangles.insert(triangles.end(), t.begin(), t.end());
        shapes.push_back({triangle_shape(mesh.material.col(t[0]), mesh.material.col(t[1]),
                                         mesh.material.col(t[2]))});
      }
      for (const Hinge& h : hinges(mesh)) {
        edges.insert(edges.end(), h.vertices.begin(), h.vertices.end());
        flat_hinges.push_back({1, 0, 0});
      }
      system.add<GreenTriangle>(triangles, shapes, BlockLaw(sheet, 0.01));
      system.add<DihedralHinge>(edges, flat_hinges, ScalarLaw(sheet.bend, 4, 0.01));
      system.set_sweep(kind);
      system.set_positions(start);
      for (int k = 0; k < 10; ++k) system.sweep(Derivatives::none);
      return system.positions();
    };
    const Points one = swept(1);
    EXPECT_TRUE(one.allFinite());
    EXPECT_GT((one - start).norm(), 1e-3);
    EXPECT_EQ(one, swept(2));
    EXPECT_EQ(one, swept(0));
  }
}

}  // namespace
}  // namespace weft::xpbd::xpbd_schedule_test
