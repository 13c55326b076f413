#include "weft/estimate/cantilever.h"

#include <fmt/core.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "commands.h"
#include "options.h"
#include "priors_text.h"
#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/capture/table_file.h"
#include "weft/estimate/bend_prior.h"
#include "weft/fabric/fabric.h"
#include "weft/vision/strip_profile.h"

namespace weft::app {
namespace {

constexpr double kReadTo = 1e-3;  // m, an overhang

struct CantileverArguments {
  std::string profile;
  double areal_density = 0;
  std::optional<double> overhang, pixel;
  double angle = 41.5;  // degrees
  double window = 0;
  std::vector<double> clamp;
  std::string curve, fabric, direction = "weft", out, prior;
  std::optional<double> deviation;  // m, of an overhang
  bool json = false;
};

/// A fabric's bending along one thread, in the fabric's own model.
struct FabricWithBend {
  Fabric fabric;
  std::string name;  ///< of the bend
};
FabricWithBend with_bend(const CantileverArguments& arguments, double rigidity,
                         const std::string& how) {
  Fabric fabric = find_fabric(arguments.fabric);
  const bool weft = arguments.direction == "weft";
  std::string name = weft ? "weft_bend" : "warp_bend";
  if (fabric.model == "stvk") name = weft ? "bend_uu" : "bend_vv";
  if (fabric.model.starts_with("baraff-witkin")) name = "bend_stiffness";
  if (fabric.model == "springs" || fabric.model == "piecewise-linear")
    throw Error(fmt::format("--fabric: a {} fabric has no flexural rigidity to set", fabric.model));
  if (name.ends_with("_bend")) fabric.set_curve(name, StiffnessCurve(rigidity));
  fabric.set(name, rigidity);
  fabric.provenance += fmt::format("; {} from a cantilever test ({})", name, how);
  validate(fabric);
  return {std::move(fabric), std::move(name)};
}

/// What was asked for of the fabric: with the rigidity, and with a prior of it, which is returned.
std::vector<ParameterPrior> write_fabrics(const CantileverArguments& arguments, double rigidity) {
  if (arguments.fabric.empty()) return {};
  const auto [fabric, name] = with_bend(arguments, rigidity, "overhang");
  if (!arguments.out.empty()) write_fabric(arguments.out, fabric);
  if (arguments.prior.empty()) return {};
  const std::vector<ParameterPrior> priors{prior_of_overhang(
      name, rigidity, *arguments.overhang, arguments.deviation.value_or(kReadTo))};
  write_text(arguments.prior, fabric_to_toml(fabric, priors));
  return priors;
}

nlohmann::json from_overhang(const CantileverArguments& arguments,
                             std::vector<ParameterPrior>& priors) {
  const double weight = arguments.areal_density * kStandardGravity;
  const double overhang = *arguments.overhang, angle = arguments.angle * kDegree;
  const double rigidity = rigidity_of_overhang(weight, overhang, angle);
  nlohmann::json result = {{"overhang", overhang},
                           {"angle_deg", arguments.angle},
                           {"weight", weight},
                           {"rigidity", rigidity},
                           {"bending_length", bending_length(weight, rigidity)}};
  if (arguments.angle == 41.5) {
    const double c = standard_bending_length(overhang);
    result["standard_bending_length"] = c;
    result["standard_rigidity"] = flexural_rigidity(weight, c);
  }
  priors = write_fabrics(arguments, rigidity);
  if (!priors.empty()) result["priors"] = priors_json(priors);
  return result;
}

bool is_table(const std::filesystem::path& profile) { return profile.extension() == ".csv"; }

MaterialPoints read_profile(const CantileverArguments& arguments) {
  const std::filesystem::path path = arguments.profile;
  if (is_table(path)) {
    const TableFile table(path);
    MaterialPoints profile(2, static_cast<Eigen::Index>(table.row_count()));
    profile.row(0) = table.numbers("x").transpose();
    profile.row(1) = table.numbers("y").transpose();
    return profile;
  }
  if (!arguments.pixel) throw Error("--pixel: needed with a picture, m");
  StripProfileOptions options;
  if (!arguments.clamp.empty()) options.clamp = Vec2(arguments.clamp[0], arguments.clamp[1]);
  MaterialPoints profile = find_strip_profile(read_grey_image(path), options) * *arguments.pixel;
  profile.row(1) *= -1;
  const Vec2 clamp = profile.col(0);
  profile = profile.colwise() - clamp;
  if (profile(0, profile.cols() - 1) < 0) profile.row(0) *= -1;
  return profile;
}

void write_curve(const std::string& path, const MaterialPoints& profile,
                 const MomentCurvature& curve) {
  std::string text = "arc,x,y,moment,curvature\n";
  for (Eigen::Index i = 0; i < profile.cols(); ++i)
    text += fmt::format("{},{},{},{},{}\n", curve.arc[i], profile(0, i), profile(1, i),
                        curve.moment[i], curve.curvature[i]);
  write_text(path, text);
}

nlohmann::json to_json(const CantileverFit& fit) {
  return {
      {"rigidity", fit.law.bend.stiffness(0)},
      {"friction", fit.law.friction},
      {"friction_scale", fit.law.friction > 0 ? nlohmann::json(fit.law.friction_scale) : nullptr},
      {"clamp_angle_deg", fit.root_angle / kDegree},
      {"distance_rms", fit.distance_rms},
      {"distance_max", fit.distance_max}};
}

/// Of a profile that can be fitted: what is wrong then is the window.
MomentCurvature curve_of(const CantileverArguments& arguments, const MaterialPoints& profile,
                         double weight) {
  return with_errors_at({.key = fmt::format("--window {:g}", arguments.window)},
                        [&] { return moment_curvature(profile, weight, arguments.window); });
}

nlohmann::json from_points(const CantileverArguments& arguments, const MaterialPoints& profile) {
  const double weight = arguments.areal_density * kStandardGravity;
  const CantileverFit constant = fit_cantilever(profile, weight, BendTerms::constant);
  const CantileverFit friction = fit_cantilever(profile, weight, BendTerms::friction);
  if (!arguments.curve.empty())
    write_curve(arguments.curve, profile, curve_of(arguments, profile, weight));
  if (!arguments.out.empty())
    write_fabric(arguments.out,
                 with_bend(arguments, constant.law.bend.stiffness(0), "profile").fabric);
  const VecX arc = profile_arc(profile);
  return {{"points", profile.cols()},
          {"length", arc[arc.size() - 1]},
          {"weight", weight},
          {"root_moment", profile_moment(profile, weight)[0]},
          {"constant", to_json(constant)},
          {"with_friction", to_json(friction)}};
}

nlohmann::json from_profile(const CantileverArguments& arguments) {
  const MaterialPoints profile = read_profile(arguments);
  return with_errors_at({.file = arguments.profile},
                        [&] { return from_points(arguments, profile); });
}

void print_overhang(const nlohmann::json& r) {
  const auto number = [&](const char* key) { return r[key].get<double>(); };
  fmt::print("overhang          {:.4g} m, the tip {:.4g} degrees below the edge\n",
             number("overhang"), number("angle_deg"));
  fmt::print("weight            {:.4g} N/m^2\n", number("weight"));
  fmt::print("rigidity B        {:.4g} N m by the heavy elastica, bending length {:.4g} m\n",
             number("rigidity"), number("bending_length"));
  if (r.contains("standard_rigidity"))
    fmt::print("ASTM D1388        G = w c^3 = {:.4g} N m with c = half of the overhang\n",
               number("standard_rigidity"));
}

void print_profile(const nlohmann::json& r) {
  fmt::print("profile           {} points, {:.4f} m long\n", r["points"].get<int>(),
             r["length"].get<double>());
  fmt::print("root moment       {:.4f} N (per width)\n", r["root_moment"].get<double>());
  for (const char* key : {"constant", "with_friction"}) {
    const nlohmann::json& fit = r[key];
    fmt::print("{:<17} B {:.4g} N m", key == std::string("constant") ? "constant" : "with friction",
               fit["rigidity"].get<double>());
    if (!fit["friction_scale"].is_null())
      fmt::print(", friction {:.3g} N over {:.3g} 1/m", fit["friction"].get<double>(),
                 fit["friction_scale"].get<double>());
    fmt::print("; clamp {:.1f} degrees below the horizontal; distance rms {:.2f}, max {:.2f} mm\n",
               fit["clamp_angle_deg"].get<double>(), 1e3 * fit["distance_rms"].get<double>(),
               1e3 * fit["distance_max"].get<double>());
  }
}

/// Options that would say nothing.
void refuse_unused(const CantileverArguments& arguments, const CLI::App& command) {
  if (arguments.prior.empty() && arguments.deviation)
    throw Error("--deviation: means nothing without --prior");
  refuse_without(command, "--fabric", {"--direction"});
  if (arguments.overhang) {
    refuse_options(command, {"--pixel", "--clamp", "--window", "--curve"}, "an overhang");
    return;
  }
  refuse_options(command, {"--angle", "--prior", "--deviation"}, "a profile or a picture");
  if (is_table(arguments.profile)) refuse_options(command, {"--pixel", "--clamp"}, "a CSV");
  refuse_without(command, "--curve", {"--window"});
}

void run_cantilever(const CantileverArguments& arguments, const CLI::App& command) {
  if (arguments.overhang.has_value() == !arguments.profile.empty())
    throw Error("give either a profile or --overhang");
  refuse_unused(arguments, command);
  if (arguments.fabric.empty() != (arguments.out.empty() && arguments.prior.empty()))
    throw Error("--fabric: needed with --out or --prior, and one of them with it");
  refuse_same_file(
      {{"--curve", arguments.curve}, {"--out", arguments.out}, {"--prior", arguments.prior}},
      {{"the profile", arguments.profile}, {"--fabric", arguments.fabric}});
  for (const std::string& path : {arguments.out, arguments.prior, arguments.curve})
    if (!path.empty()) check_output_file(path);
  std::vector<ParameterPrior> priors;
  const nlohmann::json result =
      arguments.overhang ? from_overhang(arguments, priors) : from_profile(arguments);
  if (arguments.json)
    fmt::print("{}\n", result.dump(2));
  else if (arguments.overhang)
    print_overhang(result);
  else
    print_profile(result);
  if (!arguments.json && !priors.empty()) print_priors(priors);
}

}  // namespace

void add_cantilever(CLI::App& app) {
  auto* command =
      add_command(app, "cantilever",
                  "flexural rigidity from a cantilever test: an overhang, a profile, a photograph");
  auto arguments = std::make_shared<CantileverArguments>();
  command->add_option("profile", arguments->profile,
                      "CSV with columns x, y (m, from the clamp to the tip, y up), or a picture of "
                      "the strip's edge, bright before a dark ground");
  command->add_option("--areal-density", arguments->areal_density, "kg/m^2")
      ->required()
      ->check(number_in(0.001, 10));
  command->add_option("--overhang", arguments->overhang, "m, at --angle")
      ->check(number_in(0.001, 1));
  command
      ->add_option("--angle", arguments->angle,
                   "degrees below the horizontal, of the line from edge to tip")
      ->check(number_in(1, 74))
      ->capture_default_str();
  command->add_option("--pixel", arguments->pixel, "m, of a picture")->check(number_in(1e-7, 0.01));
  command
      ->add_option("--clamp", arguments->clamp,
                   "px: x y in the picture where the strip leaves the clamp; default: the "
                   "brightest point of the left and right border")
      ->expected(2);
  command
      ->add_option("--window", arguments->window,
                   "m to both sides that a curvature of --curve is taken over; 0: a third of the "
                   "length, or more where that holds fewer than 8 points")
      ->check(number_in(0, 1))
      ->capture_default_str();
  command->add_option("--curve", arguments->curve,
                      "CSV to write: arc length, profile, moment per width and curvature");
  command->add_option("--fabric", arguments->fabric, "preset or file to take the rigidity into");
  command->add_option("--direction", arguments->direction, "of the strip")
      ->check(CLI::IsMember({"weft", "warp"}))
      ->capture_default_str();
  command->add_option("--out", arguments->out, "the fabric with the rigidity, a file to write");
  command->add_option("--prior", arguments->prior,
                      "of an overhang: the fabric with the rigidity as a prior, too, a file to "
                      "write, for weft fit --initial");
  command
      ->add_option("--deviation", arguments->deviation,
                   "m, standard deviation of the overhang, for --prior; default: 0.001")
      ->check(number_in(1e-6, 0.1));
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Examples:\n  weft cantilever --overhang 0.11 --areal-density 0.2\n"
      "  weft cantilever photo.jpg --pixel 1.1e-4 --areal-density 1.39 --curve bend.csv\n"
      "  weft cantilever --overhang 0.09 --areal-density 0.2 --direction warp --fabric base.toml "
      "--out mine.toml\n"
      "  weft cantilever --overhang 0.09 --areal-density 0.2 --fabric base.toml --prior "
      "known.toml");
  command->callback([arguments, command] { run_cantilever(*arguments, *command); });
}

}  // namespace weft::app
