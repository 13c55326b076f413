#include "weft/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "report/sample_report.h"

namespace weft::report_test {
namespace {

using test::infinity;
using test::sample_report;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

/// A report that gives no cause for warnings.
Report sound_report() {
  Report report = sample_report();
  report.error_initial = 1;
  report.diverged = 0;
  report.parameters.resize(1);
  report.remarks.clear();
  report.searches.clear();
  return report;
}

TEST(ReportMeans, FitAndValidationApart) {
  const ReportCapture capture = sample_report().captures[0];
  const auto fit = report_means(capture, ReportFrame::Kind::fit);
  ASSERT_TRUE(fit.has_value());
  EXPECT_EQ(fit->frames, 2u);
  EXPECT_DOUBLE_EQ(fit->fold, 15);
  EXPECT_DOUBLE_EQ(fit->silhouette, 100.5);
  EXPECT_DOUBLE_EQ(fit->error, 15 + 10.05);
  ASSERT_TRUE(fit->distance.has_value());
  EXPECT_DOUBLE_EQ(fit->distance->mean, 0.0015);
  EXPECT_DOUBLE_EQ(fit->distance->rms, std::sqrt((4e-6 + 16e-6) / 2));
  EXPECT_DOUBLE_EQ(fit->distance->max, 0.01);
  EXPECT_DOUBLE_EQ(report_means(capture, ReportFrame::Kind::validation)->fold, 35);
}

TEST(ReportMeans, NothingWithoutFramesAndInfiniteWhereOneWasNotReached) {
  ReportCapture capture = sample_report().captures[0];
  capture.frames[3].error = infinity;
  EXPECT_EQ(report_means(capture, ReportFrame::Kind::validation)->error, infinity);
  capture.frames[2].distance.reset();
  EXPECT_FALSE(report_means(capture, ReportFrame::Kind::validation)->distance.has_value());
  capture.frames.resize(2);
  EXPECT_FALSE(report_means(capture, ReportFrame::Kind::validation).has_value());
}

TEST(ReportWarnings, NoneWithoutCause) { EXPECT_TRUE(report_warnings(sound_report()).empty()); }

TEST(ReportWarnings, NameParametersThatAreNotDeterminedOrAtABound) {
  const auto warnings = report_warnings(sample_report());
  EXPECT_THAT(warnings, Contains(HasSubstr("do not determine bend_damping")));
  EXPECT_THAT(warnings,
              Contains(HasSubstr("drag_linear ended at the upper end of its range (10 N·m)")));
  EXPECT_THAT(warnings, Contains(HasSubstr("3 of 40 simulations diverged")));
  EXPECT_EQ(warnings.back(), "A remark.");
}

TEST(ReportWarnings, SayWhatIsOfAPrior) {
  Report report = sound_report();
  ReportParameter& p = report.parameters[0];
  p.determined = false;
  p.prior_median = p.prior_factor = 2;
  p.interval_lower = 0.5 * p.value;
  p.interval_upper = 2 * p.value;
  EXPECT_TRUE(is_of_prior(p));
  const auto warnings = report_warnings(report);
  EXPECT_THAT(warnings, Contains(HasSubstr("say little of " + p.name + " beside its prior")));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("do not determine"))));
  p.interval_lower = 0;
  p.interval_upper = infinity;
  EXPECT_FALSE(is_of_prior(p));
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("do not determine")));
}

TEST(ReportWarnings, SayWhichSideIsBounded) {
  Report report = sound_report();
  ReportParameter& p = report.parameters[0];
  const auto digits = [](double value) { return std::to_string(static_cast<int>(1e6 * value)); };
  EXPECT_EQ(interval_ends(p), IntervalEnds::both);
  p.determined = false;
  p.interval_lower = 2e-6;
  p.interval_upper = infinity;
  EXPECT_EQ(interval_ends(p), IntervalEnds::lower);
  EXPECT_EQ(interval_in_words(p, digits), "at least 2");
  auto warnings = report_warnings(report);
  EXPECT_THAT(warnings, Contains(HasSubstr(p.name + " from one side only: it is at least 2×10⁻⁶")));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("do not determine"))));
  p.interval_lower = 0;
  p.interval_upper = 5e-6;
  p.prior_median = p.prior_factor = std::nullopt;
  EXPECT_EQ(interval_ends(p), IntervalEnds::upper);
  EXPECT_EQ(interval_in_words(p, digits), "at most 5");
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("it is at most 5×10⁻⁶")));
  // Drag that is determined may be none at all.
  p.determined = true;
  EXPECT_EQ(interval_ends(p), IntervalEnds::both);
  p.determined = false;
  p.interval_upper = infinity;
  EXPECT_EQ(interval_ends(p), IntervalEnds::none);
  EXPECT_EQ(interval_in_words(p, digits), "unbounded");
}

TEST(ReportWarnings, LeaveHeldParametersAlone) {
  Report report = sound_report();
  report.parameters[0].free = false;
  report.parameters[0].determined = false;
  report.parameters[0].at_bound = ReportParameter::Bound::lower;
  EXPECT_TRUE(report_warnings(report).empty());
}

TEST(ReportWarnings, SearchesThatDidNotGetAnywhere) {
  Report report = sound_report();
  report.stopped = true;
  report.error = 0.95;
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("was stopped after 40 evaluations")));
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("hardly improved")));
  report.error = infinity;
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("there is no estimate")));
}

TEST(ReportWarnings, SearchesThatDisagree) {
  Report report = sound_report();  // one parameter, its interval 0.9 to 1.2 of its value
  const double value = report.parameters[0].value;
  report.searches = {{1, 0.100, 5, true, {value}}, {2, 0.104, 5, false, {1.19 * value}}};
  EXPECT_TRUE(report_warnings(report).empty());
  report.searches.push_back({3, 0.105, 5, false, {2 * value}});
  report.searches.push_back({4, 0.2, 5, false, {0.1 * value}});
  EXPECT_THAT(report_warnings(report),
              Contains("3 of 4 searches ended within 5 % of the least error, with bend_stiffness "
                       "3.2×10⁻⁵ to 6.4×10⁻⁵ N·m: beyond the 90 % interval, which tells of what is "
                       "near the estimate alone."));
  EXPECT_EQ(range_in_searches(report, 0), (std::pair{value, 2 * value}));
  report.searches[1].error = report.searches[2].error = infinity;
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("Of 4 searches no other ended within")));
  EXPECT_EQ(range_in_searches(report, 0), (std::pair{value, value}));
}

TEST(ReportWarnings, CapturesWithGuessedStartsAndPoorValidation) {
  Report report = sound_report();
  report.captures[0].start = "arch";
  report.captures[0].start_measured = false;
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("starts from a guessed shape (arch)")));
  EXPECT_THAT(report_warnings(report), Not(Contains(HasSubstr("carry over"))));
  // The mean of the fit frames is 25.05; of the validation frames, 4 times that.
  for (ReportFrame& frame : report.captures[0].frames) {
    if (frame.validation) frame.error = 100.2;
  }
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("4.0 times as large")));
  report.captures[0].frames[0].error = infinity;
  EXPECT_THAT(report_warnings(report), Contains(HasSubstr("does not reach all fit frames")));
}

}  // namespace
}  // namespace weft::report_test
