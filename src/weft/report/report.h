#pragma once
/// What a report shows, as plain values: no type of the modules that compute them, so that a report
/// can be read from a file and shown again without running anything.
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// One parameter of the fabric. Values in `unit`.
struct ReportParameter {
  enum class Bound { none, lower, upper };
  /// In which it is searched and shown: value, log(value), log(1 + value / 0.1).
  enum class Scale { linear, logarithmic, shifted_logarithmic };
  std::string name;     ///< "bend_stiffness"
  std::string unit;     ///< "N m"
  std::string meaning;  ///< one sentence
  double value = 0;
  double lower = 0, upper = 0;  ///< range of the search
  double initial = 0;           ///< where the search started
  Scale scale = Scale::logarithmic;
  bool free = true;  ///< false: held at its value
  /// The parameter whose search gives it its value, in a fixed proportion; empty: none, it is
  /// searched by itself, or held.
  std::string tied_to;
  /// Change of the parameter, %, that raises the error by 1 % (Bhat 2003, section 5); infinity
  /// where the data do not determine it; nothing where it was not computed.
  std::optional<double> variability_percent;
  /// 90 % interval of the value; an end that the data do not bound is infinite, or, below, 0
  /// (interval_ends()). Nothing where it was not computed.
  std::optional<double> interval_lower, interval_upper;
  std::optional<double> prior_median, prior_factor;  ///< ParameterPrior; both or neither
  bool determined = true;  ///< false: the data do not determine it; its value is no measurement
  Bound at_bound = Bound::none;
};

/// How sure the estimate is as a whole; intervals stand with their parameters. Matrices have a row
/// for each name in `parameters`, in search coordinates scaled to the ranges.
struct ReportCertainty {
  double confidence = 0.9;  ///< of the intervals
  int clusters = 0;  ///< left out in turn: of blocks of frames, of parts of the picture, the fewer
  double condition = 0;  ///< of the problem; infinity: singular
  /// Of a video Uncertainty::noise, rad^2; at rest 2, of residuals over theirs.
  double noise = 0;
  /// Uncertainty::dispersion, in the unit of the error; at rest that of the stated noise.
  double dispersion = 0;
  /// At rest ResidualCertainty::overdispersion; nothing of a video, whose dispersion has it.
  std::optional<double> overdispersion;
  int frames_per_cluster = 1;
  /// What was left out in turn, in words.
  std::string left_out = "blocks of frames and parts of the picture";
  std::vector<std::string> parameters;  ///< the free ones
  MatX correlation;                     ///< NaN where a parameter is not determined or held
  MatX covariance;
  MatX information;
  VecX slope;  ///< Uncertainty::slope; empty in files of older versions
};
/// From here on some combination of parameters is taken not to be determined.
inline constexpr double largest_condition = 1e12;

/// Distance between the simulated and the true surface at the same (u, v), m.
struct ReportDistance {
  double mean = 0, rms = 0, max = 0;
};

/// One frame of one capture.
struct ReportFrame {
  enum class Kind { fit, validation };
  int index = 0;                           ///< of the capture
  double time = 0;                         ///< s
  bool validation = false;                 ///< held back from the fit
  double error = 0;                        ///< fold + alpha * silhouette (Bhat 2003, equation 8)
  double fold = 0;                         ///< rad^2
  double silhouette = 0;                   ///< px
  std::optional<ReportDistance> distance;  ///< where the capture has a known surface

  Kind kind() const { return validation ? Kind::validation : Kind::fit; }
};

struct ReportCapture {
  std::string name;
  std::string description;
  std::string folder;
  double width = 0, height = 0;     ///< swatch, m
  double areal_density = 0;         ///< kg/m^2
  double hem_width = 0;             ///< m
  double frame_rate = 0;            ///< 1/s
  int frame_count = 0;              ///< of the video
  int fit_first = 0, fit_last = 0;  ///< inclusive
  int columns = 0, rows = 0;        ///< vertices of the simulated swatch
  std::string start;           ///< where the motion started: "measured surface", or a shape's name
  bool start_measured = true;  ///< false: the start was guessed
  std::vector<ReportFrame> frames;  ///< at the estimate
};

/// The search, one entry an evaluation, in the order in which they were asked for.
struct ReportHistoryPoint {
  std::size_t evaluation = 0;  ///< from 1
  std::string phase;           ///< "coarse search", "annealing"
  double error = 0;            ///< infinity: diverged
  double best = 0;             ///< so far
  double temperature = 0;      ///< 0 where there is none
};

/// Where one of several whole searches ended.
struct ReportSearch {
  std::uint64_t seed = 0;
  double error = 0;
  std::size_t evaluations = 0;
  bool kept = false;           ///< its end is the estimate
  std::vector<double> values;  ///< one for each of Report::parameters
};
/// Searches that ended within this part above the least error count as near it: so much of an
/// error is luck with where a descent ends.
inline constexpr double near_the_least = 0.05;

/// Error about the estimate when one parameter changes (Bhat 2003, Fig. 4).
struct ReportPerturbation {
  std::string parameter;
  std::vector<double> relative;     ///< change of the parameter divided by its value
  std::vector<double> error;        ///< one a change; infinity: diverged
  double quadratic[3] = {0, 0, 0};  ///< error = c0 + c1 r + c2 r^2
};

/// Error over two parameters, the others at the estimate (Bhat 2003, Fig. 3).
struct ReportSurface {
  std::string capture;
  std::string x_parameter, x_unit, y_parameter, y_unit;
  bool x_logarithmic = true, y_logarithmic = true;
  std::vector<double> x, y;  ///< values of the parameters, increasing
  MatX error;                ///< [y][x]; infinity: diverged
  double x_estimate = std::numeric_limits<double>::quiet_NaN();  ///< NaN: not shown
  double y_estimate = std::numeric_limits<double>::quiet_NaN();
};

/// Error of each fabric's parameters on each capture (Bhat 2003, Fig. 14).
struct ReportMatrix {
  std::vector<std::string> captures;  ///< rows
  std::vector<std::string> fabrics;   ///< columns
  MatX error;                         ///< [capture][fabric]; infinity: diverged
};

using ReportValue = std::variant<bool, std::int64_t, double, std::string>;

/// A result and how it was made.
struct Report {
  std::string title;   ///< "Fit of cotton_waving_A"
  std::string fabric;  ///< name
  std::string model;   ///< "baraff-witkin"
  std::string program_version;
  std::string command;  ///< command line
  std::string created;  ///< local time, ISO 8601
  std::string method;   ///< "coarse search, then annealing"
  std::uint64_t seed = 0;
  bool stopped = false;                 ///< ended before its time; the best so far is reported
  double error_initial = 0, error = 0;  ///< that the search minimized
  std::optional<double> prior_error;    ///< what priors add to it; nothing without priors
  std::string error_meaning;            ///< "per frame and masked pixel, summed over captures"
  std::size_t evaluations = 0;
  std::size_t diverged = 0;  ///< evaluations whose simulation diverged: infinite error
  double wall_s = 0;
  int threads = 0;
  std::vector<std::pair<std::string, ReportValue>> settings;
  std::vector<ReportParameter> parameters;
  std::optional<ReportCertainty> certainty;  ///< nothing where it was not computed
  std::vector<ReportCapture> captures;
  std::vector<ReportHistoryPoint> history;
  std::vector<ReportSearch> searches;  ///< empty: there was one
  std::vector<ReportPerturbation> perturbations;
  std::vector<ReportSurface> surfaces;
  std::optional<ReportMatrix> matrix;
  std::vector<std::string> remarks;  ///< further warnings of whoever made it, plainly worded
};

/// The setting that says what the 90 % intervals hold, and its value where that is also what the
/// width of the cells does to the estimate.
inline constexpr std::string_view intervals_setting = "intervals";
inline constexpr std::string_view noise_and_mesh = "noise and mesh";

/// Means over frames of one kind. Infinite where the simulation did not reach one of them.
struct ReportMeans {
  std::size_t frames = 0;
  double error = 0, fold = 0, silhouette = 0;
  /// Mean of means, root of the mean square, largest: where every frame has a distance.
  std::optional<ReportDistance> distance;
};
/// Nothing where there are no such frames.
std::optional<ReportMeans> report_means(const ReportCapture& capture, ReportFrame::Kind kind);

/// What a reader must know before the numbers, most serious first, one sentence or two each:
/// stopped early, errors that did not fall, parameters that the data do not determine, parameters
/// at a bound (both without those that are tied to another), a condition number above
/// largest_condition, simulations that diverged, guessed starts, validation frames that fit much
/// worse; several searches that disagree; then `remarks`.
std::vector<std::string> report_warnings(const Report& report);

/// Whether value and interval are the prior's: the data do not determine it.
bool is_of_prior(const ReportParameter& parameter);

/// The ends that the interval has: both of a parameter that is determined or of its prior, at most
/// one, which the data bound it by, of another. `both` also where the variability alone says that
/// it is not determined; `none` without an interval.
enum class IntervalEnds { none, lower, upper, both };
IntervalEnds interval_ends(const ReportParameter& parameter);

/// "1 to 2", "at least 1", "at most 2" or "unbounded", the numbers written by `format`.
std::string interval_in_words(const ReportParameter& parameter,
                              const std::function<std::string(double)>& format);

/// Whether the value is inside of the 90 % interval of the parameter, to a thousandth; true where
/// there is none.
bool in_interval(const ReportParameter& parameter, double value);

/// The least and the largest value of parameter `index` in the searches that ended near the least
/// error; the estimate twice without searches.
std::pair<double, double> range_in_searches(const Report& report, std::size_t index);

/// Whether it is one of the numbers that were searched: free, and not tied to another.
bool is_searched(const ReportParameter& parameter);

}  // namespace weft
