/// Weft as a library: how a filmed motion answers to each parameter of a fabric.
///
///     response CAPTURE [FABRIC]
///
/// Simulates FABRIC (a name or a file, satin-waving by default) in the experiment of the capture,
/// and prints how far the lowest vertex of the last frame moves per percent of each parameter, by
/// exact derivatives of the simulation.
#include <cstdio>
#include <exception>
#include <numeric>
#include <string>
#include <vector>

#include "weft/capture/capture.h"
#include "weft/dynamics/sensitivity.h"
#include "weft/fabric/fabric.h"
#include "weft/registration/stripe_surface.h"

int main(int argc, char** argv) try {
  if (argc < 2) {
    std::fprintf(stderr, "usage: response CAPTURE [FABRIC]\n");
    return 2;
  }
  const weft::Capture capture = weft::read_capture(argv[1]);
  const weft::Fabric fabric = weft::find_fabric(argc > 2 ? argv[2] : "satin-waving");

  constexpr int vertices_along_a_side = 13, last_frame = 10;
  weft::Scene scene =
      weft::make_scene(capture, vertices_along_a_side, vertices_along_a_side, 0, last_frame);
  scene.start = weft::generic_starts(scene).front().x;

  const std::vector<std::string> names = fabric.value_names();
  std::vector<int> parameters(names.size());
  std::iota(parameters.begin(), parameters.end(), 0);
  const auto [motion, by_parameter] = weft::simulate_with_sensitivities(scene, fabric, parameters);
  if (motion.diverged) {
    std::fprintf(stderr, "the simulation stopped: %s\n", motion.divergence.c_str());
    return 1;
  }

  const weft::Points& last = motion.frames.back();
  Eigen::Index lowest = 0;
  last.row(2).minCoeff(&lowest);
  std::printf("vertex %d at %.4f, %.4f, %.4f m; moves per percent of\n", static_cast<int>(lowest),
              last(0, lowest), last(1, lowest), last(2, lowest));
  for (const int i : parameters) {
    const weft::Vec3 derivative = by_parameter.x.back().block<3, 1>(3 * lowest, i);
    std::printf("  %-20s %8.4f mm\n", names[static_cast<std::size_t>(i)].c_str(),
                1e3 * derivative.norm() * 0.01 * fabric.values[i]);
  }
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "response: %s\n", error.what());
  return 2;
}
