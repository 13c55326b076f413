#include "weft/estimate/cusick.h"

#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/mesh/mesh_io.h"
#include "weft/vision/strip_profile.h"

namespace weft::app {
namespace {

struct Arguments {
  std::string fabric, shadow, out;
  std::optional<double> areal_density, pixel;
  int starts = 6, threads = 0;
  DrapeOptions options;
  bool json = false;
};

nlohmann::json to_json(const DrapeShadow& shadow) {
  return {
      {"drape_coefficient", shadow.coefficient}, {"lobes", shadow.lobes}, {"area", shadow.area}};
}

/// Cloth where the picture differs from its corner by half of its range.
nlohmann::json measured(const Arguments& arguments) {
  if (!arguments.pixel) throw Error("--pixel: needed with --shadow, m");
  const Image grey = read_grey_image(arguments.shadow);
  const float ground = grey(0, 0), contrast = (grey - ground).abs().maxCoeff();
  if (contrast < 0.1f) throw Error(arguments.shadow + ": no shadow stands out from the ground");
  const Mask mask = ((grey - ground).abs() > 0.5f * contrast).cast<std::uint8_t>();
  return to_json(shadow_of(mask, *arguments.pixel, arguments.options.test));
}

nlohmann::json simulated(const Arguments& arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  const std::optional<double> density =
      arguments.areal_density ? arguments.areal_density : fabric.areal_density;
  if (!density) throw Error("--areal-density: needed, the fabric has none");
  const auto shapes =
      sample_drapes(fabric, *density, arguments.starts, arguments.options, arguments.threads);
  nlohmann::json drapes = nlohmann::json::array();
  double sum = 0, squares = 0, lobes = 0;
  int failed = 0;
  for (const DrapeShape& shape : shapes) {
    drapes.push_back(to_json(shape.shadow));
    drapes.back()["converged"] = shape.converged;
    drapes.back()["net_force"] = shape.residual;
    sum += shape.shadow.coefficient;
    squares += shape.shadow.coefficient * shape.shadow.coefficient;
    lobes += shape.shadow.lobes;
    failed += shape.converged ? 0 : 1;
  }
  const double n = arguments.starts, mean = sum / n;
  nlohmann::json result = {{"drape_coefficient", mean},
                           {"lobes", lobes / n},
                           {"not_converged", failed},
                           {"drapes", drapes}};
  result["drape_coefficient_deviation"] =
      n > 1 ? nlohmann::json(std::sqrt(std::max(0.0, (squares - n * mean * mean) / (n - 1))))
            : nlohmann::json(nullptr);
  if (!arguments.out.empty())
    write_obj(arguments.out, shapes[0].mesh, shapes[0].x, "drape of " + fabric.name);
  return result;
}

void print(const nlohmann::json& result) {
  fmt::print("drape coefficient {:.3f}", result["drape_coefficient"].get<double>());
  if (result.contains("drape_coefficient_deviation") &&
      !result["drape_coefficient_deviation"].is_null())
    fmt::print(" +- {:.3f} over the starts", result["drape_coefficient_deviation"].get<double>());
  fmt::print("\nlobes             {:g}\n", result["lobes"].get<double>());
  if (!result.contains("drapes")) return;
  int index = 0;
  for (const nlohmann::json& drape : result["drapes"])
    fmt::print("  start {}: {:.3f}, {} lobes{}\n", ++index,
               drape["drape_coefficient"].get<double>(), drape["lobes"].get<int>(),
               drape["converged"].get<bool>() ? "" : ", no equilibrium");
}

void run(const Arguments& arguments) {
  if (arguments.fabric.empty() == arguments.shadow.empty())
    throw Error("give either a fabric or --shadow");
  if (!arguments.out.empty()) {
    if (arguments.fabric.empty()) throw Error("--out: means nothing for a picture");
    check_output_file(arguments.out);
  }
  const nlohmann::json result =
      arguments.fabric.empty() ? measured(arguments) : simulated(arguments);
  if (arguments.json)
    fmt::print("{}\n", result.dump(2));
  else
    print(result);
}

}  // namespace

void add_cusick(CLI::App& app) {
  auto* command = app.add_subcommand(
      "cusick", "drape coefficient and lobes: of a fabric, simulated, or of a shadow's picture");
  auto arguments = std::make_shared<Arguments>();
  DrapeOptions& options = arguments->options;
  command->add_option("fabric", arguments->fabric, "file or preset, of any model but springs");
  command
      ->add_option("--areal-density", arguments->areal_density,
                   "kg/m^2; default: that of the fabric")
      ->check(number_in(0.001, 10));
  command
      ->add_option("--starts", arguments->starts,
                   "equilibria from so many starts: a drape has many")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--seed", options.seed, "of the first start")
      ->check(unsigned_integer())
      ->capture_default_str();
  command->add_option("--rings", options.rings, "cells from the support to the rim")
      ->check(CLI::Range(3, 100))
      ->capture_default_str();
  command->add_option("--sectors", options.sectors, "cells around, an even number")
      ->check(CLI::Range(24, 720))
      ->capture_default_str();
  command->add_option("--radius", options.test.radius, "m, of the specimen")
      ->check(number_in(0.01, 1))
      ->capture_default_str();
  command->add_option("--support", options.test.support, "m, radius of the discs that hold it")
      ->check(number_in(0.005, 1))
      ->capture_default_str();
  command->add_option("--threads", arguments->threads, "0: all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->add_option("--shadow", arguments->shadow,
                      "picture of the shadow from above instead of a fabric; its upper left corner "
                      "is ground");
  command->add_option("--pixel", arguments->pixel, "m, of the picture")
      ->check(number_in(1e-6, 0.01));
  command->add_option("--out", arguments->out, "the first drape as a mesh, .obj");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Examples:\n  weft cusick fabric.toml --areal-density 0.15\n"
      "  weft cusick --shadow drape.png --pixel 0.00138");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace weft::app
