#include "weft/fabric/fabric.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/fabric/prior.h"

namespace weft::fabric_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(ParameterTable, NamesOrderAndUnits) {
  // Units follow from the laws: w kd Cdot grad C is a force with w in m^2 and C a strain, or with w
  // a number and C an angle; drag per area is k_T v and k_N v^2 / (1 + k_f v^2).
  const std::pair<const char*, const char*> expected[] = {
      {"stretch_stiffness", "N/m"},     {"shear_stiffness", "N/m"},
      {"bend_stiffness", "N m"},        {"stretch_damping", "N s/m"},
      {"shear_damping", "N s/m"},       {"bend_damping", "N m s"},
      {"drag_linear", "N s/m^3"},       {"drag_quadratic", "N s^2/m^4"},
      {"drag_degradation", "s^2/m^2"},  {"twist_stiffness", "N m"},
      {"drag_normal_linear", "N s/m^3"}};
  const auto table = model_parameters("baraff-witkin");
  ASSERT_EQ(table.size(), std::size(expected));
  for (const ParameterInfo& optional : table.last(2))
    EXPECT_EQ(optional.presence, Presence::optional);
  EXPECT_EQ(Fabric::with_defaults("f").value_names().size(), table.size() - 2);
  EXPECT_EQ(baraff_witkin_parameters().size(), table.size() - 2);
  for (std::size_t i = 0; i < table.size(); ++i) {
    EXPECT_EQ(table[i].name, expected[i].first);
    EXPECT_EQ(table[i].unit, expected[i].second);
    EXPECT_EQ(parameter_index("baraff-witkin", table[i].name), static_cast<int>(i));
  }
}

TEST(Fabric, ATermThatIsAnotherParameterWhereLeftOutStartsAtIt) {
  for (const char* model : {"baraff-witkin", "baraff-witkin-diagonals", "baraff-witkin-hinges"}) {
    Fabric fabric = Fabric::with_defaults("f", model);
    fabric.set("bend_stiffness", 3e-4);
    fabric.include("twist_stiffness");
    EXPECT_EQ(fabric.value("twist_stiffness"), 3e-4);
    fabric.leave_out("twist_stiffness");
    // With ranges of its own, such as a file gives.
    fabric.lower = fabric.upper = fabric.values;
    const int bend = fabric.value_index("bend_stiffness");
    fabric.lower[bend] = 1e-5;
    fabric.upper[bend] = 1e-3;
    fabric.include("twist_stiffness");
    const ParameterInfo info = fabric.info(fabric.value_index("twist_stiffness"));
    EXPECT_EQ(info.lower, 1e-5);
    EXPECT_EQ(info.upper, 1e-3);
  }
}

TEST(ParameterTable, RangesHoldTheirDefaults) {
  for (const std::string_view model : model_names())
    for (const ParameterInfo& info : model_parameters(model)) {
      EXPECT_LT(info.lower, info.upper) << info.name;
      EXPECT_GE(info.default_value, info.lower) << info.name;
      EXPECT_LE(info.default_value, info.upper) << info.name;
      if (info.scale != Scale::linear) {
        EXPECT_GE(info.lower, 0) << info.name;
      }
      if (info.scale == Scale::logarithmic) {
        EXPECT_GT(info.lower, 0) << info.name;
      }
      EXPECT_FALSE(info.meaning.empty() || info.source.empty()) << info.name;
    }
}

TEST(ParameterTable, UnknownNamesAreErrors) {
  EXPECT_THROW(model_parameters("felt"), Error);
  try {
    parameter_index("baraff-witkin", "bend");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("\"bend\""), HasSubstr("bend_stiffness")));
  }
}

TEST(ParameterTable, IsTheDocumentedOne) {
  std::ifstream file(std::string(WEFT_SOURCE_DIR) + "/docs/formats.md");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const auto number = [](double value) {  // as the document writes powers of ten
    std::string out = fmt::format("{}", value);
    if (value != 0 && value < 0.1) out = fmt::format("1e-{}", std::lround(-std::log10(value)));
    return out;
  };
  for (const ParameterInfo& info : baraff_witkin_parameters()) {
    const std::string row = fmt::format("| {} to {} | {} |", number(info.lower), number(info.upper),
                                        number(info.default_value));
    const std::size_t at = text.find(fmt::format("| `{}` | ", info.name));
    ASSERT_NE(at, std::string::npos) << info.name;
    EXPECT_THAT(text.substr(at, text.find('\n', at) - at), HasSubstr(row));
  }
  const std::size_t begin = text.find("format = \"weft-fabric\"");
  ASSERT_NE(begin, std::string::npos);
  const std::string example = text.substr(begin, text.find("```", begin) - begin);
  EXPECT_EQ(fabric_from_toml(example, "formats.md").values, find_fabric("satin").values);
}

TEST(Scaling, EndsMiddleAndRoundTrip) {
  for (const ParameterInfo& info : baraff_witkin_parameters()) {
    EXPECT_NEAR(to_scaled(info, info.lower), 0, 1e-14);
    EXPECT_NEAR(to_scaled(info, info.upper), 1, 1e-14);
    EXPECT_EQ(from_scaled(info, 0), info.lower);
    EXPECT_EQ(from_scaled(info, 1), info.upper);
    const double middle =
        info.scale == Scale::logarithmic
            ? std::sqrt(info.lower * info.upper)
            : 0.1 * (std::sqrt((1 + info.lower / 0.1) * (1 + info.upper / 0.1)) - 1);
    EXPECT_NEAR(from_scaled(info, 0.5), middle, 1e-12 * middle);
    for (double t = 0; t <= 1; t += 1.0 / 64) {
      const double value = from_scaled(info, t);
      EXPECT_GE(value, info.lower);
      EXPECT_LE(value, info.upper);
      EXPECT_NEAR(to_scaled(info, value), t, 1e-13);
    }
  }
}

TEST(Fabric, SetChecksTheArgument) {
  Fabric fabric = Fabric::with_defaults("x");
  fabric.set("bend_stiffness", 2e-5);
  EXPECT_EQ(fabric.value("bend_stiffness"), 2e-5);
  for (const double bad : {0.0, -1.0, 1.0, std::nan(""), static_cast<double>(INFINITY)}) {
    EXPECT_THROW(fabric.set("bend_stiffness", bad), Error) << bad;
    EXPECT_EQ(fabric.value("bend_stiffness"), 2e-5);
  }
  EXPECT_THROW(fabric.set("bend", 1e-5), Error);
  EXPECT_THROW(Fabric::with_defaults("x", "felt"), Error);
}

TEST(FabricFile, RoundTripIsExact) {
  Fabric fabric = find_fabric("satin");
  fabric.name = "a \"quoted\" name\\ with a tab\t and Gewebe\u00e4";
  fabric.areal_density = 0.1 + 0.2;
  fabric.set("stretch_stiffness", 1000.0 / 3);
  fabric.provenance = "line one\nline two";
  const Fabric again = fabric_from_toml(fabric_to_toml(fabric), "x.toml");
  EXPECT_EQ(again.name, fabric.name);
  EXPECT_EQ(again.model, fabric.model);
  EXPECT_EQ(again.provenance, fabric.provenance);
  EXPECT_EQ(again.areal_density, fabric.areal_density);
  EXPECT_EQ(again.values, fabric.values);
}

TEST(FabricFile, RangesInTheFileAreKept) {
  Fabric fabric = Fabric::with_defaults("x");
  Fabric read = fabric_from_toml(fabric_to_toml(fabric), "x.toml");
  const int bend = parameter_index(read.model, "bend_stiffness");
  EXPECT_EQ(read.info(bend).lower, 1e-7);
  read.lower[bend] = 5e-6;
  read.upper[bend] = 0.1;  // wider than the table
  read.set("bend_stiffness", 0.05);
  const Fabric again = fabric_from_toml(fabric_to_toml(read), "x.toml");
  EXPECT_EQ(again.info(bend).lower, 5e-6);
  EXPECT_EQ(again.info(bend).upper, 0.1);
  EXPECT_EQ(again.value("bend_stiffness"), 0.05);
  EXPECT_THROW(read.set("bend_stiffness", 1e-6), Error);
}

/// The text of a valid file with `from` replaced by `to`.
std::string edited(const std::string& from, const std::string& to) {
  std::string text = fabric_to_toml(find_fabric("linen-waving"));
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

void expect_error(const std::string& text, const std::string& what, const std::string& more = "") {
  try {
    fabric_from_toml(text, "cloth.toml");
    FAIL() << "accepted: " << what;
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("cloth.toml"), HasSubstr(what), HasSubstr(more)));
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << "not one line";
  }
}

TEST(FabricFile, BadInputNamesFileKeyAndReason) {
  expect_error(edited("name = ", "nmae = "), "name");
  expect_error(edited("[parameters]", "colour = \"red\"\n[parameters]"), "colour");
  expect_error(edited("bend_stiffness = {", "bent_stiffness = {"), "bend_stiffness");
  expect_error(edited("[parameters]", "[parameters]\npoisson = { value = 0.3 }"), "poisson");
  expect_error(edited("unit = \"N/m\",", "unit = \"N/m\", prior = 1,"), "prior");
  expect_error(edited("value = 2935.3", "valeu = 2935.3"), "value");
  expect_error(edited("value = 2935.3", "value = 99999"), "value", "5000");
  expect_error(edited("value = 2935.3", "value = -1"), "value");
  expect_error(edited("value = 2935.3", "value = nan"), "value");
  expect_error(edited("value = 2935.3", "value = \"stiff\""), "value");
  expect_error(edited("unit = \"N/m\"", "unit = \"Pa\""), "unit", "N/m");
  expect_error(edited("lower = 5,", "lower = 6000,"), "lower");
  expect_error(edited("lower = 5,", "lower = -5,"), "lower");
  expect_error(edited("model = \"baraff-witkin\"", "model = \"felt\""), "model", "baraff-witkin");
  expect_error(edited("format = \"weft-fabric\"", "format = \"weft-capture\""), "format");
  expect_error(edited("version = 1", "version = 2"), "version");
  expect_error(edited("[parameters]", "areal_density = 0\n[parameters]"), "areal_density");
  expect_error("format = ", "cloth.toml");
}

TEST(FabricFile, PriorsAreReadAndChecked) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "fabric.toml";
  const auto with_prior = [](const std::string& prior) {
    return edited("unit = \"N/m\", lower = 5,",
                  "unit = \"N/m\", prior = " + prior + ", lower = 5,");
  };
  std::ofstream(path) << with_prior("{ median = 2000, factor = 1.5 }");
  EXPECT_EQ(read_fabric(path).values, find_fabric("linen-waving").values);
  const auto priors = read_priors(path);
  ASSERT_EQ(priors.size(), 1u);
  EXPECT_EQ(priors[0].parameter, "stretch_stiffness");
  EXPECT_EQ(priors[0].median, 2000);
  EXPECT_EQ(priors[0].factor, 1.5);
  EXPECT_TRUE(find_priors("linen").empty());
  EXPECT_EQ(find_priors(path.string()).size(), 1u);

  expect_error(with_prior("{ median = 2000 }"), "prior.factor", "missing");
  expect_error(with_prior("{ median = 2, factor = 2 }"), "prior.median", "5");
  expect_error(with_prior("{ median = 2000, factor = 1 }"), "prior.factor", "1.001");
  expect_error(with_prior("{ median = 2000, factor = -3 }"), "prior.factor");
  expect_error(with_prior("{ median = nan, factor = 2 }"), "prior.median");
  expect_error(with_prior("{ median = 2000, factor = 2, sigma = 1 }"), "sigma");
}

// A factor away from the median is one standard deviation away, in both kinds of scale.
TEST(Prior, AFactorIsOneStandardDeviation) {
  for (const ParameterInfo& info : baraff_witkin_parameters()) {
    const double shift = info.scale == Scale::shifted_log ? 0.1 : 0;
    const double median = info.default_value, factor = 1.3;
    const ScaledPrior prior = scaled_prior(info, {std::string(info.name), median, factor});
    EXPECT_NEAR(to_scaled(info, median), prior.mean, 1e-12) << info.name;
    EXPECT_NEAR(to_scaled(info, factor * (median + shift) - shift), prior.mean + prior.deviation,
                1e-9)
        << info.name;
  }
}

TEST(FabricFile, EveryModelRoundTrips) {
  for (const std::string_view model : model_names()) {
    Fabric fabric = Fabric::with_defaults("cloth", std::string(model));
    for (const ParameterInfo& info : model_parameters(model)) fabric.include(info.name);
    if (!model.starts_with("baraff-witkin")) {
      EXPECT_GT(fabric.value("shear_friction_scale"), 0);
      Fabric half = fabric;
      half.leave_out("shear_friction_scale");
      EXPECT_THROW(validate(half), Error);
    }
    validate(fabric);
    const Fabric again = fabric_from_toml(fabric_to_toml(fabric), "cloth.toml");
    EXPECT_EQ(again.model, model);
    EXPECT_EQ(again.values, fabric.values);
    EXPECT_EQ(fabric_to_toml(again), fabric_to_toml(fabric));
  }
}

Fabric curved() {
  Fabric fabric = Fabric::with_defaults("cloth", "soft-constraints");
  fabric.set_curve("warp_stretch",
                   StiffnessCurve(Eigen::Vector3d(0, 0.05, 0.2), Eigen::Vector3d(100, 200, 700)));
  fabric.set_curve("diagonal_bend",
                   StiffnessCurve(Eigen::Vector2d(0, 50), Eigen::Vector2d(1e-6, 1.0 / 3)));
  return fabric;
}

TEST(FabricFile, CurvesRoundTrip) {
  Fabric fabric = curved();
  EXPECT_EQ(fabric.values.size(), 6 + 2 + 1);
  fabric.include("shear_stiffening");
  EXPECT_EQ(fabric.values.size(), 6 + 2 + 1 + 1);
  const std::string text = fabric_to_toml(fabric);
  EXPECT_THAT(text, HasSubstr("warp_stretch = { strain = [0, 0.05, 0.2], value = [100, 200, 700]"));
  const Fabric again = fabric_from_toml(text, "cloth.toml");
  EXPECT_EQ(again.values, fabric.values);
  EXPECT_EQ(fabric_to_toml(again), text);
  EXPECT_EQ(again.curve("warp_stretch").knots(), Eigen::Vector3d(0, 0.05, 0.2));
  EXPECT_EQ(again.value("warp_stretch_3"), 700);
  EXPECT_EQ(again.info(again.value_index("diagonal_bend_2")).unit, "N m");
  EXPECT_EQ(again.info(2).name, "warp_stretch_2");
  EXPECT_THROW(again.value("warp_stretch"), Error);
  EXPECT_THROW(again.value("stretch_coupling"), Error);
  EXPECT_THROW(again.curve("stretch_coupling"), Error);
}

TEST(Fabric, RowsChangeTheirForm) {
  Fabric fabric = fabric_from_toml(fabric_to_toml(curved()), "cloth.toml");
  fabric.set_curve("shear", StiffnessCurve(Eigen::Vector2d(0, 0.3), Eigen::Vector2d(10, 30)));
  EXPECT_EQ(fabric.lower.size(), fabric.values.size());
  EXPECT_EQ(fabric.value("shear_2"), 30);
  EXPECT_EQ(fabric.value("weft_bend"), 1e-5);  // what follows has moved along
  fabric.set("shear_2", 40);
  EXPECT_THROW(fabric.set("shear_2", 1e9), Error);
  fabric.set_curve("shear", StiffnessCurve(25));
  fabric.set_curve("warp_stretch", StiffnessCurve(25));
  fabric.set_curve("diagonal_bend", StiffnessCurve(1e-5));
  EXPECT_EQ(fabric.value("shear"), 25);
  fabric.include("stretch_coupling");
  validate(fabric);
  fabric.set("stretch_coupling", 120);  // above sqrt(500 * 25) = 111.8
  EXPECT_THROW(validate(fabric), Error);
  fabric.leave_out("stretch_coupling");
  validate(fabric);
  EXPECT_EQ(fabric.values.size(), 6);
  EXPECT_THROW(fabric.leave_out("shear"), Error);
  EXPECT_THROW(fabric.set_curve("shear_stiffening", StiffnessCurve(1)), Error);
  EXPECT_THROW(Fabric::with_defaults("a", "stvk").set_curve("bend_uu", StiffnessCurve(1)), Error);
}

TEST(FabricFile, BadCurvesNameFileKeyAndReason) {
  const std::string good = fabric_to_toml(curved());
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const auto found = text.find(from);
    EXPECT_NE(found, std::string::npos) << from;
    return text.replace(found, from.size(), to);
  };
  expect_error(with("strain = [0, 0.05, 0.2]", "strain = [0, 0.2, 0.05]"), "strain", "increase");
  expect_error(with("strain = [0, 0.05, 0.2]", "strain = [0, 0.05]"), "value", "2");
  expect_error(with("strain = [0, 0.05, 0.2]", "strain = []"), "strain");
  expect_error(with("strain = [0, 0.05, 0.2]", "strain = 0"), "strain");
  expect_error(with("value = [100, 200, 700]", "value = 100"), "value");
  expect_error(with("value = [100, 200, 700]", "value = [100, -200, 700]"), "value");
  expect_error(with("value = [100, 200, 700]", "value = [100, 200, 7e6]"), "value", "1000000");
  Fabric stvk = Fabric::with_defaults("cloth", "stvk");
  stvk.values[1] = 900;
  expect_error(fabric_to_toml(stvk), "parameters", "membrane_uv");
}

TEST(FabricFile, FilesOnDisk) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "fabric.toml";
  write_fabric(path, find_fabric("knit-static-2"));
  EXPECT_EQ(read_fabric(path).values, find_fabric("knit-static-2").values);
  EXPECT_EQ(find_fabric(path.string()).name, "knit-static-2");
  std::filesystem::remove(path);
  EXPECT_THROW(read_fabric(path), Error);
  EXPECT_THROW(write_fabric("/no/such/folder/x.toml", find_fabric("knit")), Error);
  try {
    find_fabric("cotton");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("cotton"), HasSubstr("linen-waving"), HasSubstr("knit-static-2")));
  }
}

TEST(Presets, TwelveOfThemWithProvenance) {
  std::set<std::string> names;
  for (const Fabric& fabric : fabric_presets()) {
    names.insert(fabric.name);
    EXPECT_THAT(fabric.provenance, AllOf(HasSubstr("Table"), HasSubstr("Exp"), HasSubstr("SI")));
    for (int i = 0; i < fabric.values.size(); ++i) {
      EXPECT_GE(fabric.values[i], fabric.info(i).lower);
      EXPECT_LE(fabric.values[i], fabric.info(i).upper);
    }
  }
  EXPECT_EQ(names.size(), 12U);
  for (const char* kind : {"linen", "fleece", "satin", "knit"}) {
    EXPECT_EQ(find_fabric(kind).name, std::string(kind) + "-waving");
    for (const char* test : {"-static-1", "-static-2", "-waving"})
      EXPECT_TRUE(names.contains(std::string(kind) + test));
  }
}

TEST(Presets, ValuesOfThePaper) {
  // Table 3: of the two experiments the one with the smaller E1 + E2 (the text works satin out).
  EXPECT_EQ(find_fabric("satin").value("stretch_stiffness"), 32.4);
  EXPECT_EQ(find_fabric("satin").value("bend_stiffness"), 5.6e-6);
  EXPECT_EQ(find_fabric("satin").value("drag_quadratic"), 1.5);
  EXPECT_EQ(find_fabric("linen").value("bend_stiffness"), 0.0008);   // 194.0 against 198.9
  EXPECT_EQ(find_fabric("fleece").value("shear_stiffness"), 296.9);  // 402.4 against 409.8
  EXPECT_EQ(find_fabric("knit").value("stretch_stiffness"), 69.7);   // 470.6 against 471.6
  // Table 1.
  EXPECT_EQ(find_fabric("linen-static-1").value("bend_stiffness"), 0.009);
  EXPECT_EQ(find_fabric("fleece-static-2").value("stretch_damping"), 0.064);
  EXPECT_EQ(find_fabric("satin-static-2").value("shear_stiffness"), 69.65);
  EXPECT_EQ(find_fabric("knit-static-1").value("shear_damping"), 0.13);
}

}  // namespace
}  // namespace weft::fabric_test
