#include <algorithm>
#include <cmath>
#include <queue>

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
  Vec3 direction;     ///< of the camera ray, scaled to unit depth
  bool known = false;
  double row = 0;     ///< projector row, px
  double depth = 0;   ///< camera depth, m
};

/// Camera rays against the projector's planes of light.
class LightPlanes {
 public:
  LightPlanes(const Rig& rig, const Vec3& reference) : rig_(&rig) {
    const Vec3 pixel = rig.camera.project(reference);
    const Vec3 below = rig.camera.unproject({pixel.x(), pixel.y() + 1}, pixel.z());
    const double rows =
        rig.projector.project(below).y() - rig.projector.project(reference).y();
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

  /// Row of the stripe edge of this kind that is nearest to the ray's row at `depth`. Edges from dark
  /// to bright lie at whole periods, from bright to dark half a period on.
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

  void add_anchor(const Rig& rig, const Vec3& fixture) {
    const Vec3 pixel = rig.camera.project(fixture);
    const double radius = anchor_periods * planes_.image_period();
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const StripeEdge& edge = nodes_[k].edge;
      if (std::hypot(edge.column + 0.5 - pixel.x(), edge.y - pixel.y()) > radius) continue;
      offer(k, pixel.z(), planes_.direction(pixel.head<2>()), 1.0);
    }
  }

  void run() {
    while (!queue_.empty()) {
      const Offer best = queue_.top();
      queue_.pop();
      Node& node = nodes_[best.node];
      if (node.known) continue;
      if (!accept(node, best.row)) continue;
      offer_neighbours(best.node);
    }
  }

  /// Sets the index of every edge of the next region without one so that it joins the known points
  /// best. False when no region is left.
  bool next_region() {
    while (next_unknown_ < nodes_.size() &&
           (nodes_[next_unknown_].known || tried(next_unknown_))) {
      ++next_unknown_;
    }
    if (next_unknown_ >= nodes_.size()) return false;
    place_region(next_unknown_);
    return true;
  }

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

  bool tried(std::size_t k) const { return !tried_.empty() && tried_[k]; }

  bool accept(Node& node, double row) {
    const double depth = planes_.depth(node.direction, row);
    if (std::isnan(depth) || !planes_.inside(node.direction, depth)) return false;
    if (!reach_.contains(planes_.point(node.direction, depth))) return false;
    node.known = true;
    node.row = row;
    node.depth = depth;
    return true;
  }

  void offer(std::size_t k, double depth, const Vec3& direction, double handicap) {
    Node& node = nodes_[k];
    if (node.known) return;
    const double row = planes_.edge_row(node, depth);
    const double candidate = planes_.depth(node.direction, row);
    if (std::isnan(candidate)) return;
    const double jump = std::abs(candidate - depth);
    const double lateral = depth * (node.direction - direction).norm();
    if (jump > depth_noise + steepest_slope * lateral) return;
    if (handicap == 0 && jump > max_jump_) return;
    queue_.push({handicap + jump / (lateral + depth_noise), k, row});
  }

  template <class Visit>
  void for_neighbours(std::size_t k, Visit&& visit) const {
    const StripeEdge& edge = nodes_[k].edge;
    const int columns = static_cast<int>(first_.size()) - 1;
    for (int c = std::max(edge.column - 3, 0); c <= std::min(edge.column + 3, columns - 1); ++c) {
      if (c == edge.column) continue;
      const double height = 2.0 * std::abs(c - edge.column);
      for (std::size_t n = first_[static_cast<std::size_t>(c)];
           n < first_[static_cast<std::size_t>(c) + 1]; ++n) {
        if (nodes_[n].edge.rising == edge.rising && std::abs(nodes_[n].edge.y - edge.y) <= height) {
          visit(n);
        }
      }
    }
    const std::size_t begin = first_[static_cast<std::size_t>(edge.column)];
    const std::size_t end = first_[static_cast<std::size_t>(edge.column) + 1];
    for (std::size_t n = std::max(begin + 2, k) - 2; n < std::min(end, k + 3); ++n) {
      if (n != k) visit(n);
    }
  }

  void offer_neighbours(std::size_t k) {
    const Node node = nodes_[k];
    for_neighbours(k, [&](std::size_t n) { offer(n, node.depth, node.direction, 0); });
  }

  void place_region(std::size_t seed);

  const LightPlanes& planes_;
  const Reach& reach_;
  std::vector<Node>& nodes_;
  double max_jump_;
  std::vector<std::size_t> first_;  ///< of each column's nodes
  std::priority_queue<Offer> queue_;
  std::size_t next_unknown_ = 0;
  std::vector<char> tried_;
};

}  // namespace
}  // namespace weft
