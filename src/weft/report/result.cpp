#include "weft/report/result.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <type_traits>
#include <utility>

#include "weft/base/error.h"
#include "weft/base/json_text.h"

namespace weft {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kVersion = 1;
/// In the order of ReportParameter::Scale.
constexpr std::string_view kScaleNames[] = {"linear", "logarithmic", "shifted-logarithmic"};

// ---- Writing

const char* word_of(double value) {
  if (std::isnan(value)) return "nan";
  return value > 0 ? "infinity" : "-infinity";
}

void put(Json& object, const std::string& key, double value) {
  if (std::isfinite(value)) {
    object[key] = value;
  } else {
    object[key] = nullptr;
    object[key + "_not_finite"] = word_of(value);
  }
}

void put(Json& object, const std::string& key, const std::optional<double>& value) {
  if (value) {
    put(object, key, *value);
  } else {
    object[key] = nullptr;
  }
}

void put(Json& object, const std::string& key, const std::vector<double>& values) {
  Json array = Json::array(), words = Json::object();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) {
      array.push_back(values[i]);
    } else {
      array.push_back(nullptr);
      words[std::to_string(i)] = word_of(values[i]);
    }
  }
  object[key] = std::move(array);
  if (!words.empty()) object[key + "_not_finite"] = std::move(words);
}

/// One member of each element as an array.
template <typename Element, typename Member>
auto column(const std::vector<Element>& elements, Member member) {
  using Value = std::decay_t<decltype(elements.front().*member)>;
  std::vector<Value> values;
  values.reserve(elements.size());
  for (const Element& element : elements) values.push_back(element.*member);
  return values;
}

std::vector<double> row_major(const MatX& matrix) {
  std::vector<double> values;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) values.push_back(matrix(i, j));
  }
  return values;
}

Json json_of(const ReportParameter& p) {
  Json object;
  put(object, "value", p.value);
  object["unit"] = p.unit;
  put(object, "lower", p.lower);
  put(object, "upper", p.upper);
  put(object, "initial", p.initial);
  put(object, "variability", p.variability_percent);
  put(object, "interval_lower", p.interval_lower);
  put(object, "interval_upper", p.interval_upper);
  object["determined"] = p.determined;
  object["at_bound"] = p.at_bound == ReportParameter::Bound::none    ? Json(nullptr)
                       : p.at_bound == ReportParameter::Bound::lower ? Json("lower")
                                                                     : Json("upper");
  if (p.prior_median && p.prior_factor)
    object["prior"] = {{"median", *p.prior_median}, {"factor", *p.prior_factor}};
  object["free"] = p.free;
  if (!p.tied_to.empty()) object["tied_to"] = p.tied_to;
  object["scale"] = kScaleNames[static_cast<std::size_t>(p.scale)];
  object["meaning"] = p.meaning;
  return object;
}

Json json_of(const std::optional<ReportCertainty>& certainty) {
  if (!certainty) return nullptr;
  Json object;
  put(object, "confidence", certainty->confidence);
  object["clusters"] = certainty->clusters;
  put(object, "condition", certainty->condition);
  put(object, "noise", certainty->noise);
  put(object, "dispersion", certainty->dispersion);
  if (certainty->overdispersion) put(object, "overdispersion", *certainty->overdispersion);
  object["frames_per_cluster"] = certainty->frames_per_cluster;
  object["left_out"] = certainty->left_out;
  object["parameters"] = certainty->parameters;
  put(object, "correlation", row_major(certainty->correlation));
  put(object, "covariance", row_major(certainty->covariance));
  put(object, "information", row_major(certainty->information));
  if (certainty->slope.size() > 0)
    put(object, "slope", std::vector<double>(certainty->slope.begin(), certainty->slope.end()));
  return object;
}

Json json_of(const ReportDistance& distance) {
  Json object;
  put(object, "distance_mean", distance.mean);
  put(object, "distance_rms", distance.rms);
  put(object, "distance_max", distance.max);
  return object;
}

Json json_of(const std::optional<ReportMeans>& means) {
  if (!means) return nullptr;
  Json object;
  object["frames"] = means->frames;
  put(object, "error", means->error);
  put(object, "fold", means->fold);
  put(object, "silhouette", means->silhouette);
  if (means->distance) object.update(json_of(*means->distance));
  return object;
}

Json json_of(const ReportFrame& frame) {
  Json object;
  object["index"] = frame.index;
  put(object, "time", frame.time);
  object["validation"] = frame.validation;
  put(object, "error", frame.error);
  put(object, "fold", frame.fold);
  put(object, "silhouette", frame.silhouette);
  if (frame.distance) object.update(json_of(*frame.distance));
  return object;
}

Json json_of(const ReportCapture& capture) {
  Json object;
  object["name"] = capture.name;
  object["description"] = capture.description;
  object["folder"] = capture.folder;
  put(object, "width", capture.width);
  put(object, "height", capture.height);
  put(object, "areal_density", capture.areal_density);
  put(object, "hem_width", capture.hem_width);
  put(object, "frame_rate", capture.frame_rate);
  object["frame_count"] = capture.frame_count;
  object["fit_frames"] = {capture.fit_first, capture.fit_last};
  object["vertices"] = {capture.columns, capture.rows};
  object["start"] = capture.start;
  object["start_measured"] = capture.start_measured;
  object["fit"] = json_of(report_means(capture, ReportFrame::Kind::fit));
  object["validation"] = json_of(report_means(capture, ReportFrame::Kind::validation));
  object["frames"] = Json::array();
  for (const ReportFrame& frame : capture.frames) object["frames"].push_back(json_of(frame));
  return object;
}

Json json_of(const std::vector<ReportSearch>& searches,
             const std::vector<ReportParameter>& parameters) {
  Json array = Json::array();
  for (const ReportSearch& search : searches) {
    Json object;
    object["seed"] = search.seed;
    put(object, "error", search.error);
    object["evaluations"] = search.evaluations;
    object["kept"] = search.kept;
    object["values"] = Json::object();
    for (std::size_t i = 0; i < parameters.size(); ++i)
      put(object["values"], parameters[i].name, search.values[i]);
    array.push_back(std::move(object));
  }
  return array;
}

Json json_of(const std::vector<ReportHistoryPoint>& history) {
  Json object;
  object["evaluation"] = column(history, &ReportHistoryPoint::evaluation);
  object["phase"] = column(history, &ReportHistoryPoint::phase);
  put(object, "error", column(history, &ReportHistoryPoint::error));
  put(object, "best", column(history, &ReportHistoryPoint::best));
  put(object, "temperature", column(history, &ReportHistoryPoint::temperature));
  return object;
}

Json json_of(const ReportPerturbation& p) {
  Json object;
  object["parameter"] = p.parameter;
  put(object, "relative", p.relative);
  put(object, "error", p.error);
  put(object, "quadratic", std::vector<double>(std::begin(p.quadratic), std::end(p.quadratic)));
  return object;
}

Json json_of(const ReportSurface& surface) {
  Json object;
  object["capture"] = surface.capture;
  for (const bool x : {true, false}) {
    Json axis;
    axis["parameter"] = x ? surface.x_parameter : surface.y_parameter;
    axis["unit"] = x ? surface.x_unit : surface.y_unit;
    axis["scale"] = (x ? surface.x_logarithmic : surface.y_logarithmic) ? "logarithmic" : "linear";
    put(axis, "values", x ? surface.x : surface.y);
    put(axis, "estimate", x ? surface.x_estimate : surface.y_estimate);
    object[x ? "x" : "y"] = axis;
  }
  put(object, "error", row_major(surface.error));
  return object;
}

Json json_of(const ReportMatrix& matrix) {
  Json object;
  object["captures"] = matrix.captures;
  object["fabrics"] = matrix.fabrics;
  put(object, "error", row_major(matrix.error));
  return object;
}

Json json_of(const std::vector<std::pair<std::string, ReportValue>>& settings) {
  Json object = Json::object();
  for (const auto& [key, value] : settings) {
    if (const double* number = std::get_if<double>(&value)) {
      put(object, key, *number);
    } else {
      std::visit([&, k = key](const auto& v) { object[k] = v; }, value);
    }
  }
  return object;
}

template <typename Element>
Json array_of(const std::vector<Element>& elements) {
  Json array = Json::array();
  for (const Element& element : elements) array.push_back(json_of(element));
  return array;
}

// ---- Reading

template <typename Value>
constexpr bool is_integer = std::is_integral_v<Value> && !std::is_same_v<Value, bool>;

/// An object of the file and the way to it, which errors name.
class Reader {
 public:
  Reader(const Json& json, std::string file, std::string key)
      : json_(json), file_(std::move(file)), key_(std::move(key)) {
    if (!json_.is_object()) fail("", "an object is needed");
  }

  bool has(const std::string& key) const { return json_.contains(key) && !json_[key].is_null(); }

  template <typename Value>
  void get(const std::string& key, Value& value) const {
    if constexpr (is_integer<Value>) {
      value = integer<Value>(key, at(key));
      return;
    }
    try {
      at(key).get_to(value);
    } catch (const Json::exception&) {
      fail(key, fmt::format("has a wrong type ({})", at(key).type_name()));
    }
  }

  template <typename Integer>
  requires is_integer<Integer>
  void get(const std::string& key, std::vector<Integer>& values) const {
    values.clear();
    for (const Json& element : array(key)) values.push_back(integer<Integer>(key, element));
  }

  void get(const std::string& key, double& value) const {
    value = at(key).is_null() ? not_finite(key) : number(key, at(key));
  }

  void get(const std::string& key, std::optional<double>& value) const {
    const bool absent = at(key).is_null() && !json_.contains(key + "_not_finite");
    value.reset();
    if (!absent) get(key, value.emplace());
  }

  void get(const std::string& key, std::vector<double>& values) const {
    values.clear();
    for (const Json& element : array(key)) {
      const std::string index = std::to_string(values.size());
      if (!element.is_null()) {
        values.push_back(number(key, element));
        continue;
      }
      const auto words = json_.find(key + "_not_finite");
      if (words == json_.end() || !words->is_object() || !words->contains(index)) {
        fail(key,
             fmt::format("element {} is null and \"{}_not_finite\" does not say why", index, key));
      }
      values.push_back(from_word(key, (*words)[index]));
    }
  }

  void get(const std::string& key, MatX& matrix, std::size_t rows, std::size_t columns) const {
    std::vector<double> values;
    get(key, values);
    if (values.size() != rows * columns) {
      fail(key, fmt::format("has {} numbers instead of {} x {}", values.size(), rows, columns));
    }
    matrix.resize(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
        matrix(i, j) = values[static_cast<std::size_t>(i * matrix.cols() + j)];
      }
    }
  }

  void get_pair(const std::string& key, int& first, int& second) const {
    std::vector<int> values;
    get(key, values);
    if (values.size() != 2) fail(key, "two integers are needed");
    first = values[0];
    second = values[1];
  }

  bool is(const std::string& key, const std::string& word, const std::string& otherwise) const {
    std::string text;
    get(key, text);
    if (text != word && text != otherwise) {
      fail(key, fmt::format("\"{}\" is neither \"{}\" nor \"{}\"", text, word, otherwise));
    }
    return text == word;
  }

  Reader object(const std::string& key) const { return {at(key), file_, path(key)}; }

  std::vector<Reader> objects(const std::string& key) const {
    std::vector<Reader> result;
    for (const Json& element : array(key)) {
      result.emplace_back(element, file_, fmt::format("{}[{}]", path(key), result.size()));
    }
    return result;
  }

  const Json& json() const { return json_; }

  [[noreturn]] void fail(const std::string& key, const std::string& reason) const {
    throw error_at({file_, 0, path(key)}, reason);
  }

 private:
  std::string path(const std::string& key) const {
    return key_.empty() || key.empty() ? key_ + key : key_ + "." + key;
  }

  const Json& at(const std::string& key) const {
    const auto found = json_.find(key);
    if (found == json_.end()) fail(key, "is missing");
    return *found;
  }

  const Json& array(const std::string& key) const {
    if (!at(key).is_array()) fail(key, "an array is needed");
    return at(key);
  }

  template <typename Integer>
  Integer integer(const std::string& key, const Json& value) const {
    const bool held =
        value.is_number_unsigned()
            ? std::in_range<Integer>(value.get<std::uint64_t>())
            : value.is_number_integer() && std::in_range<Integer>(value.get<std::int64_t>());
    using Limits = std::numeric_limits<Integer>;
    if (!held)
      fail(key, fmt::format("an integer from {} to {} is needed, not {}", Limits::min(),
                            Limits::max(), value.dump()));
    return value.get<Integer>();
  }

  double number(const std::string& key, const Json& value) const {
    if (!value.is_number()) fail(key, fmt::format("a number is needed, not {}", value.dump()));
    return value.get<double>();
  }

  double from_word(const std::string& key, const Json& word) const {
    if (word == "infinity") return kInfinity;
    if (word == "-infinity") return -kInfinity;
    if (word == "nan") return std::numeric_limits<double>::quiet_NaN();
    fail(key + "_not_finite", "one of \"infinity\", \"-infinity\", \"nan\" is needed");
  }

  double not_finite(const std::string& key) const {
    const auto word = json_.find(key + "_not_finite");
    if (word == json_.end()) {
      fail(key, fmt::format("is null and \"{}_not_finite\" does not say why", key));
    }
    return from_word(key, *word);
  }

  const Json& json_;
  std::string file_;
  std::string key_;
};

ReportParameter parameter_from(const std::string& name, const Reader& in) {
  ReportParameter p;
  p.name = name;
  in.get("value", p.value);
  in.get("unit", p.unit);
  in.get("lower", p.lower);
  in.get("upper", p.upper);
  in.get("initial", p.initial);
  in.get("variability", p.variability_percent);
  in.get("interval_lower", p.interval_lower);
  in.get("interval_upper", p.interval_upper);
  in.get("determined", p.determined);
  if (in.has("at_bound")) {
    p.at_bound = in.is("at_bound", "lower", "upper") ? ReportParameter::Bound::lower
                                                     : ReportParameter::Bound::upper;
  }
  if (in.has("prior")) {
    in.object("prior").get("median", p.prior_median);
    in.object("prior").get("factor", p.prior_factor);
  }
  in.get("free", p.free);
  if (in.has("tied_to")) in.get("tied_to", p.tied_to);
  std::string scale;
  in.get("scale", scale);
  const auto* const found = std::ranges::find(kScaleNames, scale);
  if (found == std::end(kScaleNames)) in.fail("scale", fmt::format("\"{}\" is not known", scale));
  p.scale = static_cast<ReportParameter::Scale>(found - std::begin(kScaleNames));
  in.get("meaning", p.meaning);
  return p;
}

/// What squares add up to, but for what rounding takes from zero.
void check_diagonal(const Reader& in, const std::string& key, const MatX& matrix) {
  constexpr double kRounding = 1e-9;
  double largest = 0;
  for (const double value : matrix.diagonal()) largest = std::max(largest, value);
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    if (matrix(i, i) < -kRounding * largest)
      in.fail(key, fmt::format("element {} is {:g}; on the diagonal at least 0 is needed",
                               i * (matrix.rows() + 1), matrix(i, i)));
}

ReportCertainty certainty_from(const Reader& in) {
  ReportCertainty certainty;
  in.get("confidence", certainty.confidence);
  in.get("clusters", certainty.clusters);
  in.get("condition", certainty.condition);
  in.get("noise", certainty.noise);
  in.get("dispersion", certainty.dispersion);
  if (in.has("overdispersion")) {
    double& overdispersion = certainty.overdispersion.emplace();
    in.get("overdispersion", overdispersion);
    if (overdispersion < 1)
      in.fail("overdispersion", fmt::format("{:g}; at least 1 is needed", overdispersion));
  }
  in.get("frames_per_cluster", certainty.frames_per_cluster);
  if (certainty.frames_per_cluster < 1)
    in.fail("frames_per_cluster",
            fmt::format("{}; at least 1 is needed", certainty.frames_per_cluster));
  if (in.has("left_out")) in.get("left_out", certainty.left_out);
  in.get("parameters", certainty.parameters);
  const std::size_t n = certainty.parameters.size();
  in.get("correlation", certainty.correlation, n, n);
  in.get("covariance", certainty.covariance, n, n);
  in.get("information", certainty.information, n, n);
  if (in.has("slope")) {
    MatX slope;
    in.get("slope", slope, n, 1);
    certainty.slope = slope;
  }
  check_diagonal(in, "covariance", certainty.covariance);
  check_diagonal(in, "information", certainty.information);
  return certainty;
}

ReportFrame frame_from(const Reader& in) {
  ReportFrame frame;
  in.get("index", frame.index);
  in.get("time", frame.time);
  in.get("validation", frame.validation);
  in.get("error", frame.error);
  in.get("fold", frame.fold);
  in.get("silhouette", frame.silhouette);
  if (in.json().contains("distance_mean")) {
    ReportDistance& distance = frame.distance.emplace();
    in.get("distance_mean", distance.mean);
    in.get("distance_rms", distance.rms);
    in.get("distance_max", distance.max);
  }
  return frame;
}

ReportCapture capture_from(const Reader& in) {
  ReportCapture capture;
  in.get("name", capture.name);
  in.get("description", capture.description);
  in.get("folder", capture.folder);
  in.get("width", capture.width);
  in.get("height", capture.height);
  in.get("areal_density", capture.areal_density);
  if (in.has("hem_width")) in.get("hem_width", capture.hem_width);
  in.get("frame_rate", capture.frame_rate);
  in.get("frame_count", capture.frame_count);
  in.get_pair("fit_frames", capture.fit_first, capture.fit_last);
  in.get_pair("vertices", capture.columns, capture.rows);
  in.get("start", capture.start);
  in.get("start_measured", capture.start_measured);
  for (const Reader& frame : in.objects("frames")) capture.frames.push_back(frame_from(frame));
  return capture;
}

std::vector<ReportHistoryPoint> history_from(const Reader& in) {
  std::vector<std::size_t> evaluation;
  std::vector<std::string> phase;
  std::vector<double> error, best, temperature;
  in.get("evaluation", evaluation);
  in.get("phase", phase);
  in.get("error", error);
  in.get("best", best);
  in.get("temperature", temperature);
  const std::size_t n = evaluation.size();
  if (phase.size() != n || error.size() != n || best.size() != n || temperature.size() != n) {
    in.fail("", "its arrays differ in length");
  }
  std::vector<ReportHistoryPoint> history(n);
  for (std::size_t i = 0; i < n; ++i) {
    history[i] = {evaluation[i], phase[i], error[i], best[i], temperature[i]};
  }
  return history;
}

ReportSearch search_from(const Reader& in, const std::vector<ReportParameter>& parameters) {
  ReportSearch search;
  in.get("seed", search.seed);
  in.get("error", search.error);
  in.get("evaluations", search.evaluations);
  in.get("kept", search.kept);
  const Reader values = in.object("values");
  for (const ReportParameter& p : parameters) values.get(p.name, search.values.emplace_back());
  return search;
}

ReportPerturbation perturbation_from(const Reader& in) {
  ReportPerturbation p;
  in.get("parameter", p.parameter);
  in.get("relative", p.relative);
  in.get("error", p.error);
  std::vector<double> quadratic;
  in.get("quadratic", quadratic);
  if (quadratic.size() != 3) in.fail("quadratic", "three numbers are needed");
  if (p.relative.size() != p.error.size()) in.fail("error", "its length differs from \"relative\"");
  std::ranges::copy(quadratic, p.quadratic);
  return p;
}

ReportSurface surface_from(const Reader& in) {
  ReportSurface surface;
  in.get("capture", surface.capture);
  const Reader x = in.object("x"), y = in.object("y");
  x.get("parameter", surface.x_parameter);
  x.get("unit", surface.x_unit);
  surface.x_logarithmic = x.is("scale", "logarithmic", "linear");
  x.get("values", surface.x);
  x.get("estimate", surface.x_estimate);
  y.get("parameter", surface.y_parameter);
  y.get("unit", surface.y_unit);
  surface.y_logarithmic = y.is("scale", "logarithmic", "linear");
  y.get("values", surface.y);
  y.get("estimate", surface.y_estimate);
  in.get("error", surface.error, surface.y.size(), surface.x.size());
  return surface;
}

ReportMatrix matrix_from(const Reader& in) {
  ReportMatrix matrix;
  in.get("captures", matrix.captures);
  in.get("fabrics", matrix.fabrics);
  in.get("error", matrix.error, matrix.captures.size(), matrix.fabrics.size());
  return matrix;
}

std::vector<std::pair<std::string, ReportValue>> settings_from(const Reader& in) {
  std::vector<std::pair<std::string, ReportValue>> settings;
  for (const auto& [key, value] : in.json().items()) {
    if (value.is_boolean()) {
      settings.emplace_back(key, value.get<bool>());
    } else if (value.is_number_integer()) {
      std::int64_t number = 0;
      in.get(key, number);
      settings.emplace_back(key, number);
    } else if (value.is_number() || value.is_null()) {
      double number = 0;
      in.get(key, number);
      settings.emplace_back(key, number);
    } else if (value.is_string()) {
      constexpr std::string_view kSuffix = "_not_finite";
      const bool flag =
          key.ends_with(kSuffix) && in.json().contains(key.substr(0, key.size() - kSuffix.size()));
      if (!flag) settings.emplace_back(key, value.get<std::string>());
    } else {
      in.fail(key, "a boolean, a number or a text is needed");
    }
  }
  return settings;
}

}  // namespace

std::string result_to_json(const Report& report) {
  Json json;
  json["format"] = "weft-result";
  json["version"] = kVersion;
  json["title"] = report.title;
  json["fabric"] = report.fabric;
  json["model"] = report.model;
  put(json, "error_initial", report.error_initial);
  put(json, "error", report.error);
  if (report.prior_error) put(json, "prior_error", *report.prior_error);
  json["error_meaning"] = report.error_meaning;
  json["evaluations"] = report.evaluations;
  json["diverged"] = report.diverged;
  put(json, "wall_s", report.wall_s);
  json["method"] = report.method;
  json["seed"] = report.seed;
  json["stopped"] = report.stopped;
  json["warnings"] = report_warnings(report);
  json["remarks"] = report.remarks;
  json["program_version"] = report.program_version;
  json["command"] = report.command;
  json["created"] = report.created;
  json["threads"] = report.threads;
  json["settings"] = json_of(report.settings);
  json["parameters"] = Json::object();
  for (const ReportParameter& p : report.parameters) json["parameters"][p.name] = json_of(p);
  json["certainty"] = json_of(report.certainty);
  json["captures"] = array_of(report.captures);
  json["history"] = json_of(report.history);
  if (!report.searches.empty()) json["searches"] = json_of(report.searches, report.parameters);
  json["perturbations"] = array_of(report.perturbations);
  json["surfaces"] = array_of(report.surfaces);
  json["matrix"] = report.matrix ? json_of(*report.matrix) : Json(nullptr);
  // Names come from files: bytes that are no UTF-8 are replaced, not refused.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Report result_from_json(std::string_view text, const std::filesystem::path& name) {
  const Json json = parse_json(text, name);
  const Reader in(json, name.string(), "");
  if (json.value("format", Json()) != "weft-result") in.fail("format", "\"weft-result\" is needed");
  if (json.value("version", Json()) != kVersion) {
    in.fail("version", fmt::format("{} is needed", kVersion));
  }
  Report report;
  in.get("title", report.title);
  in.get("fabric", report.fabric);
  in.get("model", report.model);
  in.get("error_initial", report.error_initial);
  in.get("error", report.error);
  if (in.has("prior_error")) in.get("prior_error", report.prior_error);
  in.get("error_meaning", report.error_meaning);
  in.get("evaluations", report.evaluations);
  in.get("diverged", report.diverged);
  in.get("wall_s", report.wall_s);
  in.get("method", report.method);
  in.get("seed", report.seed);
  in.get("stopped", report.stopped);
  in.get("remarks", report.remarks);
  in.get("program_version", report.program_version);
  in.get("command", report.command);
  in.get("created", report.created);
  in.get("threads", report.threads);
  report.settings = settings_from(in.object("settings"));
  const Reader parameters = in.object("parameters");
  for (const auto& item : parameters.json().items()) {
    report.parameters.push_back(parameter_from(item.key(), parameters.object(item.key())));
  }
  if (in.has("certainty")) report.certainty = certainty_from(in.object("certainty"));
  for (const Reader& capture : in.objects("captures")) {
    report.captures.push_back(capture_from(capture));
  }
  report.history = history_from(in.object("history"));
  if (in.has("searches"))
    for (const Reader& search : in.objects("searches"))
      report.searches.push_back(search_from(search, report.parameters));
  for (const Reader& p : in.objects("perturbations")) {
    report.perturbations.push_back(perturbation_from(p));
  }
  for (const Reader& surface : in.objects("surfaces")) {
    report.surfaces.push_back(surface_from(surface));
  }
  if (in.has("matrix")) report.matrix = matrix_from(in.object("matrix"));
  return report;
}

void write_result(const std::filesystem::path& path, const Report& report) {
  std::ofstream file(path, std::ios::binary);
  file << result_to_json(report);
  file.close();
  if (!file) throw Error(path.string() + ": cannot be written");
}

Report read_result(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw Error(path.string() + ": cannot be read");
  return result_from_json(text.str(), path);
}

}  // namespace weft
