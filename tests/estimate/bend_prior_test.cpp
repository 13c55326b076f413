#include "weft/estimate/bend_prior.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>

#include "weft/base/error.h"

namespace weft::bend_prior_test {
namespace {

using ::testing::HasSubstr;

// Of a normal distribution 90 % are within 1.6449 standard deviations, 68.27 % within one.
TEST(BendPrior, HasTheIntervalThatItIsMadeOf) {
  const ParameterPrior prior = prior_of_interval("bend_uu", 2e-5, 8e-5);
  EXPECT_NEAR(prior.median, 4e-5, 1e-18);
  EXPECT_NEAR(std::log(prior.factor), std::log(2) / 1.644854, 1e-6);
  EXPECT_NEAR(prior_of_interval("bend_uu", 2e-5, 8e-5, 0.6826895).factor, 2, 1e-5);
  // As the fit that reads it sees it: the ends of the interval are as many deviations off.
  const Fabric fabric = Fabric::with_defaults("f", "stvk");
  const ParameterInfo info = fabric.info(fabric.value_index("bend_uu"));
  const ScaledPrior scaled = scaled_prior(info, prior);
  EXPECT_NEAR((to_scaled(info, 8e-5) - scaled.mean) / scaled.deviation, 1.644854, 1e-6);
  EXPECT_NEAR((to_scaled(info, 2e-5) - scaled.mean) / scaled.deviation, -1.644854, 1e-6);
}

// One factor of four constants: the sum of z^2 of the four, as all are multiplied by the end of the
// interval, is what that end is in one.
TEST(BendPrior, OfSeveralConstantsSaysTheirFactorOnce) {
  Fabric fabric = Fabric::with_defaults("f", "stvk");
  fabric.set("bend_uu", 3e-5);
  const std::vector<ParameterPrior> priors = priors_of_factor(fabric, 0.5, 1.8);
  ASSERT_EQ(priors.size(), 4u);
  double squares = 0;
  for (const ParameterPrior& prior : priors) {
    EXPECT_NEAR(prior.median, std::sqrt(0.9) * fabric.value(prior.parameter), 1e-12 * prior.median);
    const ParameterInfo info = fabric.info(fabric.value_index(prior.parameter));
    const ScaledPrior scaled = scaled_prior(info, prior);
    const double z =
        (to_scaled(info, 1.8 * fabric.value(prior.parameter)) - scaled.mean) / scaled.deviation;
    squares += z * z;
  }
  EXPECT_NEAR(std::sqrt(squares), 1.644854, 1e-6);
}

// B goes with L^3: 1 mm of 60 mm is 5 %.
TEST(BendPrior, OfAnOverhangIsThreeTimesItsDeviation) {
  const ParameterPrior prior = prior_of_overhang("weft_bend", 2e-5, 0.06, 1e-3);
  EXPECT_EQ(prior.median, 2e-5);
  EXPECT_NEAR(std::log(prior.factor), 0.05, 1e-12);
}

TEST(BendPrior, IsReadBackFromTheFabricThatHasIt) {
  Fabric fabric = Fabric::with_defaults("f", "soft-constraints");
  const std::vector<ParameterPrior> priors = priors_of_factor(fabric, 0.5, 2);
  const std::string text = fabric_to_toml(fabric, priors);
  EXPECT_EQ(fabric_from_toml(text, "f.toml").values, fabric.values);
  EXPECT_THAT(text, HasSubstr(prior_to_toml(priors[0])));
  EXPECT_THROW(fabric_to_toml(fabric, {{"weft_bend_friction", 1, 2}}), Error);  // left out
}

std::string message(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(BendPrior, RefusesWhatHasNone) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Fabric fabric = Fabric::with_defaults("f", "stvk-diagonal");
  EXPECT_THAT(message([&] { priors_of_factor(fabric, 0, 2); }), HasSubstr("no end on one side"));
  EXPECT_THAT(message([&] { priors_of_factor(fabric, 0.5, infinity); }),
              HasSubstr("no end on one side"));
  EXPECT_THAT(message([&] { priors_of_factor(fabric, 1e6, 2e6); }), HasSubstr("median"));
  Fabric curve = fabric;
  curve.set_curve("weft_bend", StiffnessCurve(Vec2(0, 10), Vec2(1e-5, 2e-5)));
  EXPECT_THAT(message([&] { priors_of_factor(curve, 0.5, 2); }), HasSubstr("is a curve"));
  EXPECT_THAT(message([&] { priors_of_factor(Fabric::with_defaults("f", "springs"), 0.5, 2); }),
              HasSubstr("no bend in N m"));
  EXPECT_THAT(message([&] { prior_of_overhang("b", 2e-5, 0.06, 1e-8); }), HasSubstr("factor"));
}

}  // namespace
}  // namespace weft::bend_prior_test
