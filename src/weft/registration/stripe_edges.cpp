#include "weft/registration/stripe_edges.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "weft/base/quantile.h"

namespace weft {
namespace {

// Share of the frame's typical contrast below which a change of light is taken for noise.
constexpr double least_contrast_share = 0.08;
// Share of the frame's typical modulation, (bright - dark) / (bright + dark), below which a change
// of light is taken for shading: shading dims bright and dark alike.
constexpr double least_modulation_share = 0.45;
// Distance of the rim (px) within which the end of the cloth blurs into the stripes.
constexpr int rim_margin = 2;
// Pixels on either side of an edge that its blur reaches (ramp of the pattern and pixel footprint).
constexpr double blur_reach = 1.7;

/// Light along one column, averaged over neighbouring columns with weights 1, 2, 1: stripes run
/// across the columns, so this costs no sharpness.
void column_profile(const Image& image, int column, std::vector<double>& profile) {
  const int rows = static_cast<int>(image.rows());
  const int last = static_cast<int>(image.cols()) - 1;
  const int left = std::max(column - 1, 0), right = std::min(column + 1, last);
  profile.resize(static_cast<std::size_t>(rows));
  for (int y = 0; y < rows; ++y) {
    profile[static_cast<std::size_t>(y)] =
        0.25 * (image(y, left) + 2.0 * image(y, column) + image(y, right));
  }
}

bool away_from_rim(const Mask& silhouette, int column, int row) {
  if (row < rim_margin || row + rim_margin >= silhouette.rows() || column < rim_margin ||
      column + rim_margin >= silhouette.cols()) {
    return false;
  }
  return silhouette
             .block(row - rim_margin, column - rim_margin, 2 * rim_margin + 1, 2 * rim_margin + 1)
             .minCoeff() != 0;
}

/// Two-pixel means across row boundary y (between rows y - 1 and y): positive where it gets
/// brighter.
double step_at(const std::vector<double>& profile, std::size_t y) {
  return 0.5 * (profile[y] + profile[y + 1] - profile[y - 1] - profile[y - 2]);
}

/// Steps of the profile that are larger than any of their sign nearby, as row boundaries.
struct Step {
  int row;
  double height;
};

void find_steps(const std::vector<double>& profile, double threshold, std::vector<Step>& steps) {
  steps.clear();
  const std::size_t rows = profile.size();
  for (std::size_t y = 3; y + 3 < rows; ++y) {
    const double step = step_at(profile, y);
    const double size = std::abs(step);
    if (size < threshold) continue;
    const double sign = step > 0 ? 1 : -1;
    if (sign * step_at(profile, y - 1) >= size || sign * step_at(profile, y + 1) > size) continue;
    if (!steps.empty() && (steps.back().height > 0) == (step > 0) &&
        static_cast<int>(y) - steps.back().row <= 2) {
      if (std::abs(steps.back().height) < size) steps.back() = {static_cast<int>(y), step};
      continue;
    }
    steps.push_back({static_cast<int>(y), step});
  }
}

/// Mean of the profile between continuous coordinates `from` and `to` (pixel centres inside), or
/// the profile at the nearest centre to their middle if none is.
double plateau(const std::vector<double>& profile, double from, double to) {
  const int last = static_cast<int>(profile.size()) - 1;
  const int first_row = std::clamp(static_cast<int>(std::ceil(from - 0.5)), 0, last);
  const int last_row = std::clamp(static_cast<int>(std::floor(to - 0.5)), 0, last);
  if (last_row < first_row) {
    const int row = std::clamp(static_cast<int>(std::floor(0.5 * (from + to))), 0, last);
    return profile[static_cast<std::size_t>(row)];
  }
  double sum = 0;
  for (int row = first_row; row <= last_row; ++row) sum += profile[static_cast<std::size_t>(row)];
  return sum / (last_row - first_row + 1);
}

/// Root in [0, 1] of the cubic through values at -1, 0, 1 and 2 that has values at[1] <= 0 < at[2]
/// there. A straight line would be off by up to 0.08 px: an edge's profile is S-shaped.
double cubic_root(const std::array<double, 4>& at) {
  const auto value = [&](double t) {
    return -at[0] * t * (t - 1) * (t - 2) / 6 + at[1] * (t + 1) * (t - 1) * (t - 2) / 2 -
           at[2] * (t + 1) * t * (t - 2) / 2 + at[3] * (t + 1) * t * (t - 1) / 6;
  };
  double low = 0, high = 1;
  for (int k = 0; k < 20; ++k) {
    const double middle = 0.5 * (low + high);
    (value(middle) > 0 ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

/// Where the profile crosses `level` in the direction of `sign` nearest to boundary `row`; NaN if
/// not within two pixels.
double crossing(const std::vector<double>& profile, int row, double level, double sign) {
  double best = std::nan("");
  const int rows = static_cast<int>(profile.size());
  for (int y = std::max(row - 3, 1); y <= row + 1 && y + 2 < rows; ++y) {
    const auto at = [&](int k) {
      return sign * (profile[static_cast<std::size_t>(y + k)] - level);
    };
    if (at(0) > 0 || at(1) <= 0) continue;
    const double position = y + 0.5 + cubic_root({at(-1), at(0), at(1), at(2)});
    if (std::isnan(best) || std::abs(position - row) < std::abs(best - row)) best = position;
  }
  return best;
}

double typical_contrast(const Image& intensity, const Mask& silhouette, double period) {
  std::vector<double> profile, contrasts;
  const int reach = std::max(2, static_cast<int>(std::lround(0.5 * period)));
  for (int column = 0; column < intensity.cols(); column += 4) {
    column_profile(intensity, column, profile);
    for (int y = reach; y + reach < intensity.rows(); y += reach) {
      if (!silhouette(y, column)) continue;
      const auto [least, most] =
          std::minmax_element(profile.begin() + (y - reach), profile.begin() + (y + reach + 1));
      contrasts.push_back(*most - *least);
    }
  }
  return quantile(std::move(contrasts), 0.5);
}

/// Measures the edge at step k: levels on the plateaus beside it, then where their mean is crossed.
/// False if there is no edge of at least `threshold`.
bool measure_edge(const std::vector<double>& profile, const std::vector<Step>& steps, std::size_t k,
                  double period, double threshold, StripeEdge& edge) {
  const int row = steps[k].row;
  const double longest = 0.4 * period;
  const double before = k > 0 ? steps[k - 1].row : 0;
  const double after =
      k + 1 < steps.size() ? steps[k + 1].row : static_cast<double>(profile.size());
  // Plateaus end where the neighbouring edge's blur begins, but not before the middle.
  const double top = std::min(std::max(before + blur_reach, row - longest), 0.5 * (before + row));
  const double bottom = std::max(std::min(after - blur_reach, row + longest), 0.5 * (after + row));
  const double above = plateau(profile, top, row - blur_reach);
  const double below = plateau(profile, row + blur_reach, bottom);
  const double height = below - above;
  if (height * steps[k].height <= 0 || std::abs(height) < threshold) return false;
  edge.rising = height > 0;
  edge.contrast = std::abs(height);
  edge.modulation = edge.contrast / std::max(above + below, 1e-6);
  edge.y = crossing(profile, row, 0.5 * (above + below), edge.rising ? 1 : -1);
  return !std::isnan(edge.y);
}

/// Drops edges of much less modulation than the middle of all of them.
void drop_shading(std::vector<StripeEdge>& edges) {
  if (edges.empty()) return;
  std::vector<double> modulations(edges.size());
  std::transform(edges.begin(), edges.end(), modulations.begin(),
                 [](const StripeEdge& edge) { return edge.modulation; });
  const double least = least_modulation_share * quantile(std::move(modulations), 0.5);
  std::erase_if(edges, [least](const StripeEdge& edge) { return edge.modulation < least; });
}

}  // namespace

std::vector<StripeEdge> find_stripe_edges(const Image& intensity, const Mask& silhouette,
                                          double period) {
  std::vector<StripeEdge> edges;
  const double contrast = typical_contrast(intensity, silhouette, period);
  if (!(contrast > 0) || period < 4) return edges;
  const double threshold = least_contrast_share * contrast;
  std::vector<double> profile;
  std::vector<Step> steps;
  StripeEdge edge;
  for (int column = 0; column < intensity.cols(); ++column) {
    if (silhouette.col(column).maxCoeff() == 0) continue;
    edge.column = column;
    column_profile(intensity, column, profile);
    find_steps(profile, threshold, steps);
    for (std::size_t k = 0; k < steps.size(); ++k) {
      if (away_from_rim(silhouette, column, steps[k].row) &&
          measure_edge(profile, steps, k, period, threshold, edge)) {
        edges.push_back(edge);
      }
    }
  }
  drop_shading(edges);
  return edges;
}

}  // namespace weft
