#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "textile_studies.h"
#include "weft/base/error.h"
#include "weft/estimate/cantilever.h"
#include "weft/estimate/cusick.h"
#include "weft/report/plot.h"
#include "weft/vision/strip_profile.h"

namespace weft::validation {
namespace {

constexpr double kPixel = 1 / 724.6;  // m, of the silhouettes
constexpr double kDensity = 0.15;     // kg/m^2; only the bending length counts
constexpr int kStarts = 6;

struct Statistics {
  double mean = 0, deviation = 0;
};
Statistics statistics(const std::vector<double>& values) {
  Statistics s;
  for (const double v : values) s.mean += v / static_cast<double>(values.size());
  for (const double v : values)
    s.deviation += (v - s.mean) * (v - s.mean) / static_cast<double>(values.size() - 1);
  s.deviation = std::sqrt(s.deviation);
  return s;
}

/// A fabric's drapes: coefficient and lobes, by sample and capture.
struct Drapes {
  std::vector<double> coefficient, lobes;
};
/// Pictures 1 and 2 of a sample, and 3 and 4, are repeats; between the two pairs it was turned
/// over, as far as the coefficients tell.
struct Measured {
  Drapes fitted, others;        ///< odd and even samples
  std::vector<double> repeats;  ///< of the others: difference of a pair, over sqrt(2)
  std::vector<double> sides;    ///< of the others: second pair less the first
};

int number_after(const std::string& text, const std::string& word) {
  const std::size_t at = text.find(word);
  if (at == std::string::npos) throw Error(text + ": no " + word);
  return std::stoi(text.substr(at + word.size()));
}

DrapeShadow shadow_of_picture(const std::filesystem::path& path) {
  const Image grey = read_grey_image(path);
  // The ground reaches the border, the fabric does not.
  const float ground = grey(0, 0);
  const Mask mask = ((grey - ground).abs() > 0.5f).cast<std::uint8_t>();
  return shadow_of(mask, kPixel);
}

std::map<int, Measured> read_silhouettes(const std::filesystem::path& folder) {
  std::map<int, Measured> fabrics;
  std::map<std::pair<int, int>, std::map<int, double>> others;
  std::set<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) paths.insert(entry.path());
  for (const auto& path : paths) {
    if (path.extension() != ".png") continue;
    const std::string name = path.stem().string();
    const int fabric = number_after(name, "Fabric_"), sample = number_after(name, "Sample_");
    const DrapeShadow shadow = shadow_of_picture(path);
    Drapes& drapes = sample % 2 == 1 ? fabrics[fabric].fitted : fabrics[fabric].others;
    drapes.coefficient.push_back(shadow.coefficient);
    drapes.lobes.push_back(shadow.lobes);
    if (sample % 2 == 0)
      others[{fabric, sample}][number_after(name, "Capture_")] = shadow.coefficient;
  }
  for (const auto& [key, captures] : others) {
    Measured& measured = fabrics[key.first];
    const double a = captures.at(1), b = captures.at(2), c = captures.at(3), d = captures.at(4);
    measured.repeats.insert(measured.repeats.end(),
                            {(a - b) / std::sqrt(2.0), (c - d) / std::sqrt(2.0)});
    measured.sides.push_back(0.5 * (c + d) - 0.5 * (a + b));
  }
  return fabrics;
}

Fabric isotropic(double bending_length) {
  Fabric fabric = Fabric::with_defaults("drape", "stvk");
  const double bend = flexural_rigidity(kDensity * 9.81, bending_length);
  fabric.set("bend_uu", bend);
  fabric.set("bend_uv", 1e-12);
  fabric.set("bend_vv", bend);
  fabric.set("bend_twist", 0.5 * bend);
  return fabric;
}

/// `bend` is the bending length, m.
DrapePoint simulated(double bending_length, int starts, const DrapeOptions& options) {
  return {bending_length,
          drape_statistics(sample_drapes(isotropic(bending_length), kDensity, starts, options))};
}

void print(const DrapePoint& point) {
  const DrapeStatistics& s = point.drapes;
  fmt::print("  {:>6.1f} {:>8.3f} {:>7.3f} {:>7.2f} {:>6.2f} {:>6}\n", 1e3 * point.bend,
             s.coefficient.mean, s.coefficient.deviation, s.lobes.mean, s.lobes.deviation,
             s.not_converged);
  std::fflush(stdout);
}

}  // namespace

void study_cusick(const StudyFolders& folders) {
  fmt::print(
      "simulated, {} starts each, isotropic bend, stvk membrane of the defaults: bending "
      "length (mm), coefficient, deviation, lobes, deviation, without equilibrium\n",
      kStarts);
  std::vector<DrapePoint> table;
  for (const double c : {0.007, 0.0095, 0.012, 0.015, 0.018, 0.021, 0.024, 0.028, 0.033}) {
    table.push_back(simulated(c, kStarts, {}));
    print(table.back());
  }
  fmt::print("finer, 16 rings of 160, 2 starts\n");
  DrapeOptions fine;
  fine.rings = 16;
  fine.sectors = 160;
  for (const double c : {0.015, 0.024}) print(simulated(c, 2, fine));

  fmt::print("starts with folds of 20 mm instead of 2 mm\n");
  DrapeOptions rough;
  rough.perturbation = 0.02;
  for (const double c : {0.015, 0.021}) print(simulated(c, kStarts, rough));

  fmt::print(
      "coefficient of the fitted half (mean, spread), bending length (mm); of the other half "
      "mean, spread, spread of repeats, second side less the first; spread simulated; lobes of "
      "the other half and simulated, with spread\n");
  LinePlot plot;
  plot.title = "Cusick drape: lobes and drape coefficient";
  plot.x.label = "drape coefficient";
  plot.y.label = "lobes";
  plot.y.from_zero = true;
  for (const auto& [fabric, measured] : read_silhouettes(folders.data / "cusick" / "silhouettes")) {
    const Statistics fitted = statistics(measured.fitted.coefficient);
    const Statistics others = statistics(measured.others.coefficient);
    const Statistics lobes = statistics(measured.others.lobes);
    const DrapePoint found = drape_at(table, fitted.mean);
    const VecX repeats =
        VecX::Map(measured.repeats.data(), static_cast<Eigen::Index>(measured.repeats.size()));
    fmt::print(
        "  {}: {:.3f} {:.3f}  {:>5.1f}  {:.3f} {:.3f} {:.3f} {:+.3f}  {:.3f}  {:>5.2f} {:.2f}  "
        "{:>5.2f} {:.2f}{}\n",
        fabric, fitted.mean, fitted.deviation, 1e3 * found.bend, others.mean, others.deviation,
        rms(repeats), statistics(measured.sides).mean, found.drapes.coefficient.deviation,
        lobes.mean, lobes.deviation, found.drapes.lobes.mean, found.drapes.lobes.deviation,
        fitted.mean < table.front().drapes.coefficient.mean ? "  (limper than what was simulated)"
                                                            : "");
    PlotSeries points;
    points.name = fmt::format("fabric {}", fabric);
    points.mark = PlotSeries::Mark::points;
    points.x = measured.others.coefficient;
    points.y = measured.others.lobes;
    plot.series.push_back(points);
  }
  PlotSeries line;
  line.name = "simulated, with deviation";
  line.colour = 0;
  line.mark = PlotSeries::Mark::line_and_points;
  for (const DrapePoint& point : table) {
    const DrapeStatistics& s = point.drapes;
    line.x.push_back(s.coefficient.mean);
    line.y.push_back(s.lobes.mean);
    line.lower.push_back(s.lobes.mean - s.lobes.deviation);
    line.upper.push_back(s.lobes.mean + s.lobes.deviation);
  }
  plot.series.push_back(line);
  write_plot(folders.out / "cusick.svg", plot);
}

}  // namespace weft::validation
