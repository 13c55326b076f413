#include "weft/estimate/cusick.h"

#include <fmt/core.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "commands.h"
#include "options.h"
#include "priors_text.h"
#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/estimate/bend_prior.h"
#include "weft/mesh/mesh_io.h"
#include "weft/vision/strip_profile.h"

namespace weft::app {
namespace {

struct CusickArguments {
  std::string fabric, shadow, out, prior;
  std::optional<double> areal_density, pixel, fit, fit_deviation;
  int starts = 6, threads = 0;
  DrapeOptions options;
  bool json = false;
};

nlohmann::json to_json(const DrapeShadow& shadow) {
  return {
      {"drape_coefficient", shadow.coefficient}, {"lobes", shadow.lobes}, {"area", shadow.area}};
}

/// Cloth where the picture differs from its corner by half of its range.
nlohmann::json measured(const CusickArguments& arguments) {
  if (!arguments.pixel) throw Error("--pixel: needed with --shadow, m");
  const Image grey = read_grey_image(arguments.shadow);
  const float ground = grey(0, 0), contrast = (grey - ground).abs().maxCoeff();
  if (contrast < 0.1f) throw Error(arguments.shadow + ": no shadow stands out from the ground");
  const Mask mask = ((grey - ground).abs() > 0.5f * contrast).cast<std::uint8_t>();
  try {
    return to_json(shadow_of(mask, *arguments.pixel, arguments.options.test));
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}; are --pixel, --radius and --support right?", arguments.shadow,
                            error.what()));
  }
}

double density_of(const CusickArguments& arguments, const Fabric& fabric) {
  const std::optional<double> density =
      arguments.areal_density ? arguments.areal_density : fabric.areal_density;
  if (!density) throw Error("--areal-density: needed, the fabric has none");
  return *density;
}

nlohmann::json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json to_json(const DrapeStatistics& drapes) {
  return {{"drape_coefficient", drapes.coefficient.mean},
          {"drape_coefficient_deviation", number_or_null(drapes.coefficient.deviation)},
          {"lobes", drapes.lobes.mean},
          {"not_converged", drapes.not_converged}};
}

nlohmann::json simulated(const CusickArguments& arguments) {
  const Fabric fabric = find_fabric(arguments.fabric);
  const auto shapes = sample_drapes(fabric, density_of(arguments, fabric), arguments.starts,
                                    arguments.options, arguments.threads);
  nlohmann::json result = to_json(drape_statistics(shapes));
  for (const DrapeShape& shape : shapes) {
    nlohmann::json drape = to_json(shape.shadow);
    drape["converged"] = shape.converged;
    drape["net_force"] = shape.residual;
    result["drapes"].push_back(drape);
  }
  if (!arguments.out.empty())
    write_obj(arguments.out, shapes[0].mesh, shapes[0].x, "drape of " + fabric.name);
  return result;
}

Error out_of_reach(double measured, const DrapeFit& fit) {
  const bool below = fit.reach == DrapeFit::Reach::below;
  return Error(
      fmt::format("--fit: {:g} is out of range; must be at {} {:.3f}, that of {:.3g} times the "
                  "bend, the {} end "
                  "of what can be simulated in its range",
                  measured, below ? "least" : "most", fit.drapes.coefficient.mean, fit.factor,
                  below ? "limp" : "stiff"));
}

/// The fabric whose drapes have the measured coefficient.
nlohmann::json fitted(const CusickArguments& arguments, std::vector<ParameterPrior>& priors) {
  const Fabric start = find_fabric(arguments.fabric);
  DrapeFitOptions options;
  options.drape = arguments.options;
  options.starts = arguments.starts;
  options.deviation = arguments.fit_deviation;
  options.threads = arguments.threads;
  const double density = density_of(arguments, start), measured = *arguments.fit;
  const DrapeFit fit = fit_drape(start, density, measured, options);
  if (fit.reach != DrapeFit::Reach::inside) throw out_of_reach(measured, fit);
  nlohmann::json result = to_json(fit.drapes);
  result["measured"] = measured;
  result["factor"] = fit.factor;
  result["factor_lower"] = fit.lower;
  result["factor_upper"] = number_or_null(fit.upper);
  for (const std::string& name : start.value_names()) {
    const double value = fit.fabric.value(name);
    if (start.info(start.value_index(name)).unit == "N m") result["bend"][name] = value;
  }
  Fabric fabric = fit.fabric;
  fabric.areal_density = density;
  fabric.provenance +=
      fmt::format("; bend times {:.4g} from a drape coefficient of {:g}", fit.factor, measured);
  if (!arguments.out.empty()) write_fabric(arguments.out, fabric);
  if (arguments.prior.empty()) return result;
  priors = priors_of_factor(start, fit.lower, fit.upper, options.confidence);
  result["priors"] = priors_json(priors);
  write_text(arguments.prior, fabric_to_toml(fabric, priors));
  return result;
}

void print_fit(const nlohmann::json& result) {
  fmt::print("bend times {:.3g}, {:.3g} to {} (90 %)\n", result["factor"].get<double>(),
             result["factor_lower"].get<double>(),
             result["factor_upper"].is_null()
                 ? "any"
                 : fmt::format("{:.3g}", result["factor_upper"].get<double>()));
  for (const auto& [name, value] : result["bend"].items())
    fmt::print("  {:<18} {:.4g} N m\n", name, value.get<double>());
}

void print(const nlohmann::json& result) {
  if (result.contains("factor")) print_fit(result);
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

void check_fit(const CusickArguments& arguments) {
  if (!arguments.fit) {
    if (arguments.fit_deviation) throw Error("--fit-deviation: means nothing without --fit");
    if (!arguments.prior.empty()) throw Error("--prior: means nothing without --fit");
    return;
  }
  if (arguments.fabric.empty()) throw Error("--fit: means nothing for a picture");
  if (arguments.starts < 2) throw Error("--starts: must be 2 or more with --fit");
  if (!arguments.out.empty() && std::filesystem::path(arguments.out).extension() != ".toml")
    throw Error("--out: must end in .toml with --fit, which writes a fabric");
}

/// Options that would say nothing.
void refuse_unused(const CusickArguments& arguments, const CLI::App& command) {
  if (arguments.fabric.empty() == arguments.shadow.empty())
    throw Error("give either a fabric or --shadow");
  if (arguments.fabric.empty())
    refuse_options(
        command,
        {"--areal-density", "--starts", "--seed", "--rings", "--sectors", "--threads", "--out"},
        "a picture");
  refuse_without(command, "--shadow", {"--pixel"});
  check_fit(arguments);
}

void run_cusick(const CusickArguments& arguments, const CLI::App& command) {
  refuse_unused(arguments, command);
  refuse_same_file({{"--out", arguments.out}, {"--prior", arguments.prior}},
                   {{"the fabric that is read", arguments.fabric}});
  for (const std::string& path : {arguments.out, arguments.prior})
    if (!path.empty()) check_output_file(path);
  if (arguments.options.sectors % 2 != 0)
    throw Error(fmt::format("--sectors: {} is odd; must be an even number from 24 to 720",
                            arguments.options.sectors));
  std::vector<ParameterPrior> priors;
  const nlohmann::json result = arguments.fabric.empty() ? measured(arguments)
                                : arguments.fit          ? fitted(arguments, priors)
                                                         : simulated(arguments);
  if (arguments.json)
    fmt::print("{}\n", result.dump(2));
  else
    print(result);
  if (!arguments.json && !priors.empty()) print_priors(priors);
}

}  // namespace

void add_cusick(CLI::App& app) {
  auto* command = add_command(
      app, "cusick",
      "drape coefficient and lobes: of a fabric, simulated, or of a shadow's picture; or the bend "
      "of a fabric from its coefficient");
  auto arguments = std::make_shared<CusickArguments>();
  DrapeOptions& options = arguments->options;
  command->add_option("fabric", arguments->fabric, "file or preset, of any model but springs");
  command
      ->add_option("--areal-density", arguments->areal_density,
                   "kg/m^2; default: that of the fabric")
      ->check(number_in(0.001, 10));
  command
      ->add_option("--starts", arguments->starts,
                   "equilibria from so many starts: a drape has many")
      ->check(integer_in(1, 1000))
      ->capture_default_str();
  command->add_option("--seed", options.seed, "of the first start")
      ->check(unsigned_integer())
      ->capture_default_str();
  command->add_option("--rings", options.rings, "cells from the support to the rim")
      ->check(integer_in(3, 100))
      ->capture_default_str();
  command->add_option("--sectors", options.sectors, "cells around, an even number")
      ->check(integer_in(24, 720))
      ->capture_default_str();
  command->add_option("--radius", options.test.radius, "m, of the specimen")
      ->check(number_in(0.01, 1))
      ->capture_default_str();
  command->add_option("--support", options.test.support, "m, radius of the discs that hold it")
      ->check(number_in(0.005, 1))
      ->capture_default_str();
  add_threads(*command, arguments->threads);
  command->add_option("--shadow", arguments->shadow,
                      "picture of the shadow from above instead of a fabric; its upper left corner "
                      "is ground");
  command->add_option("--pixel", arguments->pixel, "m, of the picture")
      ->check(number_in(1e-6, 0.01));
  command
      ->add_option("--fit", arguments->fit,
                   "measured drape coefficient: find the factor of all constants of the fabric's "
                   "bend with which the mean over the starts is the same")
      ->check(number_in(1e-3, 0.9999));
  command
      ->add_option("--fit-deviation", arguments->fit_deviation,
                   "standard deviation of the measured coefficient; default: it is of one drape, "
                   "which scatters as the simulated ones do")
      ->check(number_in(0, 1));
  command->add_option("--out", arguments->out,
                      "the first drape as a mesh, .obj; with --fit the fabric, .toml");
  command->add_option("--prior", arguments->prior,
                      "with --fit: the fabric found with its interval as priors of the bend, a "
                      "file to write, for weft fit --initial");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Examples:\n  weft cusick fabric.toml --areal-density 0.15\n"
      "  weft cusick --shadow drape.png --pixel 0.00138\n"
      "  weft cusick base.toml --areal-density 0.15 --fit 0.62 --fit-deviation 0.02 --out "
      "mine.toml");
  command->callback([arguments, command] { run_cusick(*arguments, *command); });
}

}  // namespace weft::app
