#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "weft/base/error.h"
#include "weft/registration/stripe_edges.h"
#include "weft/registration/stripe_surface.h"

namespace weft {
namespace {

// Depth noise of one edge, m: 0.2 px at the shallowest usual angle between camera and projector.
constexpr double depth_noise = 2e-3;
// Steepest surface whose stripes are believed: change of depth along the view over the distance
// across it. At 3.5 (74 degrees from facing the camera) stripes are squeezed to about half.
constexpr double steepest_slope = 3.5;
// Stripe periods around a fixture in which its depth decides about the index.
constexpr double anchor_periods = 2.5;
// Edges in a separate region below which it is not worth an index by plausibility.
constexpr int least_region = 40;

/// An edge and, once it is known, where it lies.
struct Node {
  StripeEdge edge;
  Vec3 direction;  ///< of the camera ray, scaled to unit depth
  enum class State { unknown, pending, known, rejected } state = State::unknown;
  double row = 0;    ///< projector row, px
  double depth = 0;  ///< camera depth, m
};

/// Camera rays against the projector's planes of light.
class LightPlanes {
 public:
  LightPlanes(const Rig& rig, const Vec3& reference) : rig_(&rig) {
    const Vec3 pixel = rig.camera.project(reference);
    const Vec3 below = rig.camera.unproject({pixel.x(), pixel.y() + 1}, pixel.z());
    const double rows = rig.projector.project(below).y() - rig.projector.project(reference).y();
    upright_ = rows > 0;
    image_period_ = rig.pattern.period / std::max(std::abs(rows), 1e-9);
  }

  /// Stripe period in the image, px, at the depth of the reference point.
  double image_period() const { return image_period_; }

  Vec3 direction(const Vec2& pixel) const {
    return rig_->camera.unproject(pixel, 1.0) - rig_->camera.center();
  }

  Vec3 point(const Vec3& direction, double depth) const {
    return rig_->camera.center() + depth * direction;
  }

  double row(const Vec3& direction, double depth) const {
    return rig_->projector.project(point(direction, depth)).y();
  }

  /// Depth at which the ray meets the plane of projector row `row`; NaN if it does not in front.
  double depth(const Vec3& direction, double row) const {
    const Projection& p = rig_->projector.projection();
    const Eigen::RowVector4d plane = p.row(1) - row * p.row(2);
    const double along = plane.head<3>().dot(direction);
    const double offset = plane.head<3>().dot(rig_->camera.center()) + plane(3);
    const double depth = -offset / along;
    return depth > 0 ? depth : std::nan("");
  }

  /// Row of the stripe edge of this kind that is nearest to the ray's row at `depth`. Edges from
  /// dark to bright lie at whole periods, from bright to dark half a period on.
  double edge_row(const Node& node, double depth) const {
    const double period = rig_->pattern.period;
    const double offset = node.edge.rising == upright_ ? 0.0 : 0.5;
    return period * (std::round(row(node.direction, depth) / period - offset) + offset);
  }

  bool inside(const Vec3& direction, double depth) const {
    if (rig_->projector_width <= 0 || rig_->projector_height <= 0) return true;
    const Vec3 p = rig_->projector.project(point(direction, depth));
    return p.x() >= 0 && p.x() <= rig_->projector_width && p.y() >= 0 &&
           p.y() <= rig_->projector_height;
  }

 private:
  const Rig* rig_;
  bool upright_ = true;
  double image_period_ = 0;
};

/// Which points the cloth can reach: a point of the fabric is nowhere further from a fixture than
/// on the undeformed fabric, but for stretch.
class Reach {
 public:
  explicit Reach(const Scene& scene) : scene_(&scene) {
    for (const PointFixture& fixture : scene.fixtures) {
      positions_.push_back(fixture.motion.position(scene.frame_times.front()));
    }
  }
  const std::vector<Vec3>& fixtures() const { return positions_; }

  bool contains(const Vec3& point) const {
    constexpr double stretched = 1.1, slack = 0.02;
    for (int v = 0; v < scene_->mesh.vertex_count(); ++v) {
      bool reached = true;
      for (std::size_t f = 0; f < positions_.size() && reached; ++f) {
        const Vec2 at = scene_->mesh.material.col(scene_->fixtures[f].vertex);
        reached = (point - positions_[f]).norm() <=
                  stretched * (scene_->mesh.material.col(v) - at).norm() + slack;
      }
      if (reached) return true;
    }
    return false;
  }

 private:
  const Scene* scene_;
  std::vector<Vec3> positions_;
};

/// Spreads the index of stripes from edge to edge, the smoothest step first.
class StripeFlood {
 public:
  StripeFlood(const LightPlanes& planes, const Reach& reach, std::vector<Node>& nodes, int columns,
              double max_jump)
      : planes_(planes), reach_(reach), nodes_(nodes), max_jump_(max_jump) {
    first_.assign(static_cast<std::size_t>(columns) + 1, 0);
    for (const Node& node : nodes) ++first_[static_cast<std::size_t>(node.edge.column) + 1];
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  }

  /// Floods from the edges around the projections of the fixtures.
  void run_from_fixtures(const Rig& rig);
  /// Joins regions that no smooth step reaches (behind folds, beyond shadows): inside a region the
  /// indices follow from continuity, and their common shift from the known points next to it.
  void join_regions(double period);
  /// Rejects known edges that do not lie on a smooth chain along their stripe.
  void reject_outliers();

 private:
  struct Offer {
    double cost;
    std::size_t node;
    double row;
    // Ties go to the lower node, so that the order never depends on the queue.
    bool operator<(const Offer& other) const {
      return cost > other.cost || (cost == other.cost && node > other.node);
    }
  };

  void offer(std::size_t k, double depth, const Vec3& direction, bool anchor);
  void offer_neighbours(std::size_t k);
  bool place(Node& node, double row) const;
  std::vector<std::size_t> flood(Node::State state);
  bool settle_region(const std::vector<std::size_t>& region, const std::vector<std::size_t>& known,
                     double period);
  std::size_t nearest(const StripeEdge& edge, const std::vector<std::size_t>& among) const;
  std::vector<std::size_t> with_state(Node::State state) const;

  const LightPlanes& planes_;
  const Reach& reach_;
  std::vector<Node>& nodes_;
  double max_jump_;
  std::vector<std::size_t> first_;  ///< of each column's nodes
  std::priority_queue<Offer> queue_;
};

void StripeFlood::run_from_fixtures(const Rig& rig) {
  const double radius = anchor_periods * planes_.image_period();
  for (const Vec3& fixture : reach_.fixtures()) {
    const Vec3 pixel = rig.camera.project(fixture);
    if (pixel.z() <= 0) continue;
    const Vec3 direction = planes_.direction(pixel.head<2>());
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const StripeEdge& edge = nodes_[k].edge;
      if (std::hypot(edge.column + 0.5 - pixel.x(), edge.y - pixel.y()) > radius) continue;
      offer(k, pixel.z(), direction, true);
    }
  }
  flood(Node::State::known);
}

void StripeFlood::offer(std::size_t k, double depth, const Vec3& direction, bool anchor) {
  const Node& node = nodes_[k];
  if (node.state != Node::State::unknown) return;
  const double row = planes_.edge_row(node, depth);
  const double candidate = planes_.depth(node.direction, row);
  if (std::isnan(candidate)) return;
  const double jump = std::abs(candidate - depth);
  const double lateral = depth * (node.direction - direction).norm();
  if (jump > depth_noise + steepest_slope * lateral) return;
  if (!anchor && jump > max_jump_) return;
  // An anchor is used only where no smooth step arrives first.
  const double handicap = anchor ? steepest_slope : 0;
  queue_.push({handicap + jump / (lateral + depth_noise), k, row});
}

void StripeFlood::offer_neighbours(std::size_t k) {
  const Node& node = nodes_[k];
  const int columns = static_cast<int>(first_.size()) - 1;
  constexpr int across = 3;             // columns that a gap in a chain may span
  constexpr double steepest_chain = 2;  // px of y a column, in the image
  const int from = std::max(node.edge.column - across, 0);
  const int to = std::min(node.edge.column + across, columns - 1);
  for (int c = from; c <= to; ++c) {
    const double height = steepest_chain * std::abs(c - node.edge.column);
    const auto end = first_[static_cast<std::size_t>(c) + 1];
    for (auto n = first_[static_cast<std::size_t>(c)]; n < end; ++n) {
      const StripeEdge& other = nodes_[n].edge;
      if (other.rising != node.edge.rising || std::abs(other.y - node.edge.y) > height) continue;
      offer(n, node.depth, node.direction, false);
    }
  }
  // Above and below: the next two edges, so that one missed edge does not end the region.
  const auto begin = first_[static_cast<std::size_t>(node.edge.column)];
  const auto end = first_[static_cast<std::size_t>(node.edge.column) + 1];
  for (auto n = std::max(begin + 2, k) - 2; n < std::min(end, k + 3); ++n) {
    offer(n, node.depth, node.direction, false);
  }
}

bool StripeFlood::place(Node& node, double row) const {
  const double depth = planes_.depth(node.direction, row);
  if (std::isnan(depth) || !planes_.inside(node.direction, depth)) return false;
  if (!reach_.contains(planes_.point(node.direction, depth))) return false;
  node.row = row;
  node.depth = depth;
  return true;
}

std::vector<std::size_t> StripeFlood::flood(Node::State state) {
  std::vector<std::size_t> reached;
  while (!queue_.empty()) {
    const Offer best = queue_.top();
    queue_.pop();
    Node& node = nodes_[best.node];
    if (node.state != Node::State::unknown || !place(node, best.row)) continue;
    node.state = state;
    reached.push_back(best.node);
    offer_neighbours(best.node);
  }
  return reached;
}

std::vector<std::size_t> StripeFlood::with_state(Node::State state) const {
  std::vector<std::size_t> found;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    if (nodes_[k].state == state) found.push_back(k);
  }
  return found;
}

std::size_t StripeFlood::nearest(const StripeEdge& edge,
                                 const std::vector<std::size_t>& among) const {
  std::size_t best = among.front();
  double least = std::numeric_limits<double>::infinity();
  for (const std::size_t k : among) {
    const StripeEdge& other = nodes_[k].edge;
    const double distance = std::hypot(other.column - edge.column, other.y - edge.y);
    if (distance < least) {
      least = distance;
      best = k;
    }
  }
  return best;
}

void StripeFlood::join_regions(double period) {
  for (std::size_t seed = 0; seed < nodes_.size(); ++seed) {
    Node& node = nodes_[seed];
    if (node.state != Node::State::unknown) continue;
    const std::vector<std::size_t> known = with_state(Node::State::known);
    if (known.empty()) return;
    const double depth = nodes_[nearest(node.edge, known)].depth;
    queue_.push({0, seed, planes_.edge_row(node, depth)});
    const std::vector<std::size_t> region = flood(Node::State::pending);
    const bool joined =
        static_cast<int>(region.size()) >= least_region && settle_region(region, known, period);
    for (const std::size_t k : region) {
      nodes_[k].state = joined ? Node::State::known : Node::State::rejected;
    }
    if (region.empty()) node.state = Node::State::rejected;
  }
}

/// Chooses the shift of a region, in whole periods, with the least median gap in depth to the known
/// points where both are nearest in the image. False if even that gap is too wide to be believed.
bool StripeFlood::settle_region(const std::vector<std::size_t>& region,
                                const std::vector<std::size_t>& known, double period) {
  struct Pair {
    double distance;
    std::size_t inside, outside;
  };
  std::vector<Pair> pairs;
  for (const std::size_t k : region) {
    const std::size_t other = nearest(nodes_[k].edge, known);
    const StripeEdge &a = nodes_[k].edge, &b = nodes_[other].edge;
    pairs.push_back({std::hypot(a.column - b.column, a.y - b.y), k, other});
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return a.distance < b.distance || (a.distance == b.distance && a.inside < b.inside);
  });
  pairs.resize(std::max<std::size_t>(pairs.size() / 4, 8));
  double best_gap = std::numeric_limits<double>::infinity(), best_step = 0;
  int best_shift = 0;
  std::vector<double> gaps(pairs.size());
  for (int shift = -3; shift <= 3; ++shift) {
    double step = 0;
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const Node& node = nodes_[pairs[p].inside];
      const double row = node.row + shift * period;
      const double depth = planes_.depth(node.direction, row);
      gaps[p] = std::abs(depth - nodes_[pairs[p].outside].depth);
      if (!(gaps[p] < 1e3)) gaps[p] = 1e3;
      step = std::abs(planes_.depth(node.direction, row + period) - depth);
    }
    const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
    std::nth_element(gaps.begin(), middle, gaps.end());
    if (*middle < best_gap) {
      best_gap = *middle;
      best_shift = shift;
      best_step = step;
    }
  }
  if (!(best_gap < 0.3 * best_step)) return false;
  for (const std::size_t k : region) {
    if (!place(nodes_[k], nodes_[k].row + best_shift * period)) return false;
  }
  return true;
}

void StripeFlood::reject_outliers() {}

/// Reads the edges as nodes with their camera rays.
std::vector<Node> make_nodes(const std::vector<StripeEdge>& edges, const LightPlanes& planes) {
  std::vector<Node> nodes(edges.size());
  for (std::size_t k = 0; k < edges.size(); ++k) {
    nodes[k].edge = edges[k];
    nodes[k].direction = planes.direction({edges[k].column + 0.5, edges[k].y});
  }
  return nodes;
}

/// Depth at the pixel centres between edges half a period apart on a column: the projector row,
/// interpolated linearly, gives the plane that the pixel's ray meets.
void fill_depth(const std::vector<Node>& nodes, const LightPlanes& planes, double period,
                Image& depth) {
  const Node* above = nullptr;
  for (const Node& node : nodes) {
    if (node.state != Node::State::known) {
      continue;
    }
    if (above && above->edge.column == node.edge.column &&
        std::abs(std::abs(node.row - above->row) - 0.5 * period) < 1e-6 * period) {
      const int first = static_cast<int>(std::ceil(above->edge.y - 0.5));
      const int last = static_cast<int>(std::floor(node.edge.y - 0.5));
      for (int y = first; y <= last; ++y) {
        const double t = (y + 0.5 - above->edge.y) / (node.edge.y - above->edge.y);
        const Vec3 direction = planes.direction({node.edge.column + 0.5, y + 0.5});
        depth(y, node.edge.column) =
            static_cast<float>(planes.depth(direction, (1 - t) * above->row + t * node.row));
      }
    }
    above = &node;
  }
}

}  // namespace

StripePoints decode_stripes(const Image& intensity, const Mask& silhouette, const Rig& rig,
                            const Scene& scene, const StripeDecodeOptions& options) {
  if (silhouette.rows() != intensity.rows() || silhouette.cols() != intensity.cols()) {
    throw Error(fmt::format("stripes: the silhouette has {} x {} pixels, the frame {} x {}",
                            silhouette.cols(), silhouette.rows(), intensity.cols(),
                            intensity.rows()));
  }
  StripePoints result;
  result.depth = Image::Zero(intensity.rows(), intensity.cols());
  const Reach reach(scene);
  if (reach.fixtures().empty()) return result;
  Vec3 center = Vec3::Zero();
  for (const Vec3& fixture : reach.fixtures()) {
    center += fixture / static_cast<double>(reach.fixtures().size());
  }
  const LightPlanes planes(rig, center);
  const std::vector<StripeEdge> edges =
      find_stripe_edges(intensity, silhouette, planes.image_period());
  std::vector<Node> nodes = make_nodes(edges, planes);
  StripeFlood flood(planes, reach, nodes, static_cast<int>(intensity.cols()),
                    options.max_depth_jump);
  flood.run_from_fixtures(rig);
  flood.join_regions(rig.pattern.period);
  flood.reject_outliers();
  fill_depth(nodes, planes, rig.pattern.period, result.depth);

  const auto known =
      static_cast<Eigen::Index>(std::count_if(nodes.begin(), nodes.end(), [](const Node& node) {
        return node.state == Node::State::known;
      }));
  result.pixel.resize(2, known);
  result.position.resize(3, known);
  Eigen::Index column = 0;
  for (const Node& node : nodes) {
    if (node.state != Node::State::known) continue;
    result.pixel.col(column) << node.edge.column + 0.5, node.edge.y;
    result.position.col(column++) = planes.point(node.direction, node.depth);
  }
  return result;
}

}  // namespace weft
