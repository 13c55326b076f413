#include "weft/estimate/profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "weft/base/error.h"

namespace weft::profile_test {
namespace {

/// Residuals (y - f(x)) / 0.02 and (x - 0.4) / s(x): the best y follows x along f, and the rise of
/// the profile of x is that of the second alone.
struct Valley {
  double bend = 0;         // of f
  double stiff = 0.1;      // s where x > 0.4
  double soft = 0.1;       // s where x < 0.4
  double infinite_at = 2;  // cost beyond this x
  double misfit = 0;       // of the cost, whatever x and y are

  double follow(double x) const { return 0.3 + bend * (x - 0.4) * (x - 0.4) * 4; }
  double width(double x) const { return x > 0.4 ? stiff : soft; }
  double cost(const VecX& x) const {
    if (x[0] > infinite_at) return std::numeric_limits<double>::infinity();
    const double a = (x[1] - follow(x[0])) / 0.02, b = (x[0] - 0.4) / width(x[0]);
    return a * a + b * b + misfit;
  }
  QuadraticModel model(const VecX& x) const {
    const double a = (x[1] - follow(x[0])) / 0.02, b = (x[0] - 0.4) / width(x[0]);
    MatX j(2, 2);
    j << -8 * bend * (x[0] - 0.4) / 0.02, 1 / 0.02, 1 / width(x[0]), 0;
    VecX r(2);
    r << a, b;
    return {cost(x), 2 * j.transpose() * r, 2 * j.transpose() * j};
  }
  Profile of(int parameter, const ProfileOptions& options = {}, double dispersion = 2) const {
    VecX estimate(2);
    estimate << 0.4, 0.3;
    return profile([this](const VecX& x) { return model(x); },
                   [this](const VecX& x) { return cost(x); }, estimate, parameter, dispersion,
                   options);
  }
};

// With dispersion 2 the rise of x is ((x - 0.4) / s)^2 / 2: the interval is 1.645 s to either side.

TEST(Profile, IsTheIntervalOfDerivativesForAParabola) {
  const Profile p = Valley{}.of(0);
  EXPECT_NEAR(p.lower, 0.4 - 0.1645, 1e-4);
  EXPECT_NEAR(p.upper, 0.4 + 0.1645, 1e-4);
  EXPECT_EQ(p.lower_end, ProfileEnd::crossed);
  EXPECT_EQ(p.upper_end, ProfileEnd::crossed);
  for (std::size_t i = 1; i < p.points.size(); ++i)
    EXPECT_LT(p.points[i - 1].x[0], p.points[i].x[0]);
}

TEST(Profile, SidesMayDiffer) {
  const Valley valley{.stiff = 0.2, .soft = 0.05};
  const Profile p = valley.of(0);
  EXPECT_NEAR(p.lower, 0.4 - 1.645 * 0.05, 1e-4);
  EXPECT_NEAR(p.upper, 0.4 + 1.645 * 0.2, 1e-4);
}

TEST(Profile, FollowsAWayThatBends) {
  // Along the straight line of the model y would be 0.1 off at the ends: a rise of 12 instead
  // of 1.35.
  const Valley valley{.bend = 1};
  const Profile p = valley.of(0);
  EXPECT_NEAR(p.upper, 0.4 + 0.1645, 2e-3);
  EXPECT_NEAR(p.lower, 0.4 - 0.1645, 2e-3);
  EXPECT_NEAR(p.points.back().x[1], valley.follow(p.points.back().x[0]), 1e-3);
}

TEST(Profile, SaysWhereTheRangeEndsFirst) {
  const Valley valley{.stiff = 10, .soft = 0.1};
  const Profile p = valley.of(0);
  EXPECT_EQ(p.upper_end, ProfileEnd::range);
  EXPECT_EQ(p.upper, 1);
  EXPECT_EQ(p.lower_end, ProfileEnd::crossed);
}

TEST(Profile, StopsShortOfAnInfiniteCost) {
  const Valley valley{.stiff = 0.5, .infinite_at = 0.62};
  const Profile p = valley.of(0);
  EXPECT_EQ(p.upper_end, ProfileEnd::infinite);
  EXPECT_LE(p.upper, 0.62);
  EXPECT_GT(p.upper, 0.55);
}

TEST(Profile, ObserverStops) {
  int seen = 0;
  VecX estimate(2);
  estimate << 0.4, 0.3;
  const Valley valley;
  const Profile p = profile([&](const VecX& x) { return valley.model(x); },
                            [&](const VecX& x) { return valley.cost(x); }, estimate, 0, 2, {},
                            [&](const ProfilePoint&) {
                              ++seen;
                              return false;
                            });
  EXPECT_EQ(seen, 1);
  EXPECT_EQ(p.lower_end, ProfileEnd::stopped);
  EXPECT_EQ(p.upper_end, ProfileEnd::stopped);
  EXPECT_EQ(p.upper, 0.4);
}

TEST(Profile, HasAsManyPointsAsMayBe) {
  ProfileOptions options;
  options.first_step = 0.01;
  options.most_points = 2;
  const Profile p = Valley{}.of(0, options);
  EXPECT_EQ(p.points.size(), 5U);
  EXPECT_EQ(p.upper_end, ProfileEnd::most_points);
  EXPECT_NEAR(p.upper, 0.4 + 0.01 + 0.02, 1e-12);  // the rise is small: twice as far
}

TEST(Profile, AShortFirstStepIsTried) {
  ProfileOptions options;
  options.first_step = 1e-3;
  const Profile p = Valley{.stiff = 1e-3, .soft = 1e-3}.of(0, options);
  EXPECT_NEAR(p.lower, 0.4 - 1.645e-3, 1e-6);
  EXPECT_NEAR(p.upper, 0.4 + 1.645e-3, 1e-6);
}

/// Residuals J (x - estimate), beside a misfit that no x mends: the interval of x_0 is known from
/// J, ((J^T J)^-1)_00.
struct Linear {
  MatX jacobian;
  double misfit = 0;
  std::vector<VecX> linearized_at{};

  Profile of(const VecX& estimate, double dispersion) {
    const auto cost = [&](const VecX& x) {
      return (jacobian * (x - estimate)).squaredNorm() + misfit;
    };
    const auto model = [&](const VecX& x) {
      linearized_at.push_back(x);
      const VecX r = jacobian * (x - estimate);
      return QuadraticModel{cost(x), 2 * jacobian.transpose() * r,
                            2 * jacobian.transpose() * jacobian};
    };
    ProfileOptions options;
    options.first_step = 0.04;
    return profile(model, cost, estimate, 0, dispersion, options);
  }
};

TEST(Profile, BeginsWhereTheModelLeads) {
  // x_1 = 0.99 x_0 is best, which the first search need not find out.
  Linear linear{MatX(2, 2)};
  linear.jacobian << 1, 0, -0.99 * 20, 20;
  linear.of(VecX::Constant(2, 0.4), 0.01);
  ASSERT_GT(linear.linearized_at.size(), 1U);
  EXPECT_NEAR(linear.linearized_at[1][0], 0.4 - 0.04, 1e-12);
  EXPECT_NEAR(linear.linearized_at[1][1], 0.4 - 0.99 * 0.04, 1e-6);
}

TEST(Profile, IsThatOfAParabolaWhateverTheMisfitAndTheStiffness) {
  // x_1 follows stiffly, x_2 softly: where it does not the cost rises five times as much.
  for (const double ratio : {1.0, 1e4, 1e6}) {
    const double stiff = std::sqrt(ratio);
    Linear linear{MatX(3, 3), 1000};
    linear.jacobian << 0.5, 0, 0,  //
        -0.5 * stiff, stiff, 0,    //
        -1, 0, 1;
    // (J^T J)^-1_00 is 4, and this dispersion makes the deviation 0.1.
    const Profile p = linear.of(VecX::Constant(3, 0.4), 2 * 0.01 / 4);
    // A hundredth of the threshold is a two-hundredth of the interval.
    EXPECT_NEAR(p.lower, 0.4 - 0.1645, 2e-3) << ratio;
    EXPECT_NEAR(p.upper, 0.4 + 0.1645, 2e-3) << ratio;
  }
}

TEST(Profile, MisfitDoesNotNarrowIt) {
  // The solver's tolerance is a part of the cost, of which the rise may be a thousandth.
  const Profile p = Valley{.bend = 1, .misfit = 2000}.of(0);
  EXPECT_NEAR(p.upper, 0.4 + 0.1645, 2e-3);
  EXPECT_NEAR(p.lower, 0.4 - 0.1645, 2e-3);
}

TEST(Profile, OptionsAreThoseOfAnInterval) {
  Uncertainty uncertainty;
  uncertainty.confidence = 0.9;
  uncertainty.clusters = 10;
  // t of 9 degrees of freedom at 95 %: 1.833.
  EXPECT_NEAR(profile_options(uncertainty, 0.1).threshold, 0.5 * 1.833 * 1.833, 5e-3);
  EXPECT_NEAR(profile_options(uncertainty, 0.1).first_step, 0.05, 1e-12);
  EXPECT_NEAR(profile_options(uncertainty, 3).first_step, 0.15, 1e-12);
  EXPECT_NEAR(profile_options(uncertainty, 1e-3).first_step, 0.02, 1e-12);
  EXPECT_NEAR(profile_options(1.645, 1e-3, 1e-5).threshold, 1.353, 1e-3);
  EXPECT_NEAR(profile_options(1.645, 1e-3, 1e-5).first_step, 5e-4, 1e-12);
  EXPECT_NEAR(profile_options(1.645, 1e-8, 1e-5).first_step, 1e-5, 1e-12);
}

TEST(Profile, RejectsBadArguments) {
  const Valley valley;
  EXPECT_THROW(valley.of(2), Error);
  EXPECT_THROW(valley.of(-1), Error);
  EXPECT_THROW(valley.of(0, {}, 0), Error);
  EXPECT_THROW(valley.of(0, {}, std::nan("")), Error);
  ProfileOptions options;
  options.threshold = 0;
  EXPECT_THROW(valley.of(0, options), Error);
  options = {};
  options.first_step = 0;
  EXPECT_THROW(valley.of(0, options), Error);
  options = {};
  options.most_points = 0;
  EXPECT_THROW(valley.of(0, options), Error);
  EXPECT_THROW(Valley{.infinite_at = 0.1}.of(0), Error);
}

}  // namespace
}  // namespace weft::profile_test
