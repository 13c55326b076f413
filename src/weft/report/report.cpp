#include "weft/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/report/text.h"

namespace weft {
namespace {

/// An error that fell by less than this part of its start is not called a fit.
constexpr double kLittleGain = 0.1;
/// Validation frames with more than this multiple of the fit frames' error are remarked upon.
constexpr double kMuchWorse = 3;

std::string bare(const ReportParameter& parameter) {
  const std::string unit = format_unit(parameter.unit);
  return unit.empty() ? "" : " " + unit;
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  return text;
}

bool has_one_end(const ReportParameter& p) {
  const IntervalEnds ends = interval_ends(p);
  return ends == IntervalEnds::lower || ends == IntervalEnds::upper;
}

void warn_of_parameters(const Report& report, std::vector<std::string>& warnings) {
  std::vector<std::string> undetermined, of_prior;
  for (const ReportParameter& p : report.parameters) {
    if (!is_searched(p) || p.determined) continue;
    if (is_of_prior(p))
      of_prior.push_back(p.name);
    else if (has_one_end(p))
      warnings.push_back(fmt::format(
          "The data bound {} from one side only: it is {}{}. Its value is no "
          "measurement.",
          p.name, interval_in_words(p, [](double v) { return format_short(v); }), bare(p)));
    else
      undetermined.push_back(p.name);
  }
  if (!of_prior.empty()) {
    const bool one = of_prior.size() == 1;
    warnings.push_back(fmt::format(
        "The data say little of {} beside {}: {}, no {}.", listed(of_prior),
        one ? "its prior" : "their priors",
        one ? "value and interval are the prior's" : "values and intervals are the priors'",
        one ? "measurement" : "measurements"));
  }
  if (!undetermined.empty()) {
    const bool one = undetermined.size() == 1;
    warnings.push_back(fmt::format(
        "The data do not determine {}: the error hardly changes when {}. Do not read {} as "
        "{}measurement{}.",
        listed(undetermined), one ? "it does" : "they do", one ? "its value" : "their values",
        one ? "a " : "", one ? "" : "s"));
  }
  for (const ReportParameter& p : report.parameters) {
    if (!is_searched(p) || p.at_bound == ReportParameter::Bound::none) continue;
    const bool upper = p.at_bound == ReportParameter::Bound::upper;
    warnings.push_back(fmt::format(
        "{} ended at the {} end of its range ({}{}): a better value may lie beyond it.", p.name,
        upper ? "upper" : "lower", format_short(upper ? p.upper : p.lower), bare(p)));
  }
}

void warn_of_condition(const Report& report, std::vector<std::string>& warnings) {
  if (!report.certainty || report.certainty->condition <= largest_condition) return;
  warnings.push_back(fmt::format(
      "The condition number of the problem is {}: some combination of parameters is not determined "
      "by the data.",
      format_value(report.certainty->condition, 2)));
}

void warn_of_captures(const Report& report, std::vector<std::string>& warnings) {
  for (const ReportCapture& capture : report.captures) {
    if (!capture.start_measured) {
      warnings.push_back(fmt::format(
          "{}: the first frame gave no surface, so the motion starts from a guessed shape ({}). "
          "From a wrong start no parameters fit.",
          capture.name, capture.start));
    }
    const auto fit = report_means(capture, ReportFrame::Kind::fit);
    const auto validation = report_means(capture, ReportFrame::Kind::validation);
    for (const auto& [means, kind] : {std::pair{fit, "fit"}, std::pair{validation, "validation"}}) {
      if (means && !std::isfinite(means->error)) {
        warnings.push_back(
            fmt::format("{}: the simulation at the estimate does not reach all {} frames.",
                        capture.name, kind));
      }
    }
    if (fit && validation && std::isfinite(validation->error) &&
        validation->error > kMuchWorse * fit->error) {
      warnings.push_back(fmt::format(
          "{}: the error per frame is {} times as large on the validation frames as on the fit "
          "frames. What was fitted does not carry over to the later motion.",
          capture.name, format_value(validation->error / fit->error, 2)));
    }
  }
}

/// The largest error that counts as near the least of the searches.
double near_limit(const Report& report) {
  double least = kInfinity;
  for (const ReportSearch& search : report.searches) least = std::min(least, search.error);
  return (1 + near_the_least) * least;
}

void warn_of_searches(const Report& report, std::vector<std::string>& warnings) {
  if (report.searches.size() < 2) return;
  const double limit = near_limit(report);
  const auto near = std::ranges::count_if(
      report.searches, [&](const ReportSearch& search) { return search.error <= limit; });
  if (near == 1) {
    warnings.push_back(
        fmt::format("Of {} searches no other ended within {:.0f} % of the least error: a further "
                    "one may find a lower one.",
                    report.searches.size(), 100 * near_the_least));
    return;
  }
  std::vector<std::string> wide;
  for (std::size_t i = 0; i < report.parameters.size(); ++i) {
    const ReportParameter& p = report.parameters[i];
    const auto [least, largest] = range_in_searches(report, i);
    if (!is_searched(p) || (in_interval(p, least) && in_interval(p, largest))) continue;
    wide.push_back(
        fmt::format("{} {} to {}{}", p.name, format_short(least), format_short(largest), bare(p)));
  }
  if (wide.empty()) return;
  warnings.push_back(fmt::format(
      "{} of {} searches ended within {:.0f} % of the least error, with {}: beyond the 90 % "
      "interval{} of what is near the estimate alone.",
      near, report.searches.size(), 100 * near_the_least, listed(wide),
      wide.size() == 1 ? ", which tells" : "s, which tell"));
}

}  // namespace

bool in_interval(const ReportParameter& parameter, double value) {
  if (!parameter.interval_lower || !parameter.interval_upper) return true;
  constexpr double kSame = 1e-3;
  const double lower = *parameter.interval_lower, upper = *parameter.interval_upper;
  return value >= lower - kSame * std::abs(lower) && value <= upper + kSame * std::abs(upper);
}

std::pair<double, double> range_in_searches(const Report& report, std::size_t index) {
  std::pair range{report.parameters[index].value, report.parameters[index].value};
  const double limit = near_limit(report);
  for (const ReportSearch& search : report.searches) {
    if (!(search.error <= limit)) continue;
    range.first = std::min(range.first, search.values[index]);
    range.second = std::max(range.second, search.values[index]);
  }
  return range;
}

bool is_of_prior(const ReportParameter& parameter) {
  return !parameter.determined && parameter.prior_median && parameter.interval_upper &&
         std::isfinite(*parameter.interval_upper);
}

IntervalEnds interval_ends(const ReportParameter& parameter) {
  if (!parameter.interval_lower || !parameter.interval_upper) return IntervalEnds::none;
  const double lower = *parameter.interval_lower;
  const bool above = std::isfinite(*parameter.interval_upper);
  // Drag that is determined may be none at all.
  const bool below = std::isfinite(lower) && (lower != 0 || (above && parameter.determined));
  if (above) return below ? IntervalEnds::both : IntervalEnds::upper;
  return below ? IntervalEnds::lower : IntervalEnds::none;
}

std::string interval_in_words(const ReportParameter& parameter,
                              const std::function<std::string(double)>& format) {
  switch (interval_ends(parameter)) {
    case IntervalEnds::both:
      return format(*parameter.interval_lower) + " to " + format(*parameter.interval_upper);
    case IntervalEnds::lower:
      return "at least " + format(*parameter.interval_lower);
    case IntervalEnds::upper:
      return "at most " + format(*parameter.interval_upper);
    case IntervalEnds::none:
      break;
  }
  return "unbounded";
}

bool is_searched(const ReportParameter& parameter) {
  return parameter.free && parameter.tied_to.empty();
}

std::optional<ReportMeans> report_means(const ReportCapture& capture, ReportFrame::Kind kind) {
  ReportMeans means;
  ReportDistance distance;
  std::size_t with_distance = 0;
  for (const ReportFrame& frame : capture.frames) {
    if (frame.kind() != kind) continue;
    ++means.frames;
    means.error += frame.error;
    means.fold += frame.fold;
    means.silhouette += frame.silhouette;
    if (!frame.distance) continue;
    ++with_distance;
    distance.mean += frame.distance->mean;
    distance.rms += frame.distance->rms * frame.distance->rms;
    distance.max = std::max(distance.max, frame.distance->max);
  }
  if (means.frames == 0) return std::nullopt;
  const auto n = static_cast<double>(means.frames);
  means.error /= n;
  means.fold /= n;
  means.silhouette /= n;
  if (with_distance == means.frames) {
    means.distance = ReportDistance{distance.mean / n, std::sqrt(distance.rms / n), distance.max};
  }
  return means;
}

std::vector<std::string> report_warnings(const Report& report) {
  std::vector<std::string> warnings;
  if (report.stopped) {
    warnings.push_back(
        fmt::format("The search was stopped after {} evaluations; this is the best until then.",
                    report.evaluations));
  }
  if (!std::isfinite(report.error)) {
    warnings.push_back("No simulation reached the end: there is no estimate.");
  } else if (std::isfinite(report.error_initial) &&
             report.error > (1 - kLittleGain) * report.error_initial) {
    warnings.push_back(
        fmt::format("The search hardly improved on its start: the error went from {} to {}.",
                    format_value(report.error_initial), format_value(report.error)));
  }
  warn_of_parameters(report, warnings);
  warn_of_condition(report, warnings);
  if (report.diverged > 0) {
    warnings.push_back(fmt::format("{} of {} simulations diverged and counted as infinitely wrong.",
                                   report.diverged, report.evaluations));
  }
  warn_of_captures(report, warnings);
  warn_of_searches(report, warnings);
  warnings.insert(warnings.end(), report.remarks.begin(), report.remarks.end());
  return warnings;
}

}  // namespace weft
