#include "weft/estimate/feature_cache.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "weft/base/error.h"
#include "weft/estimate/content_hash.h"

namespace weft {
namespace {

constexpr std::size_t kMostStarts = 1000;  // no file of ours has more
constexpr std::string_view kMagic = "weft-features-3\n";

class Writer {
 public:
  template <typename T>
  void put(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void put_text(const std::string& text) {
    put(static_cast<std::uint64_t>(text.size()));
    bytes_ += text;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Reads until the bytes run out; from then on everything is zero and ok() is false.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  template <typename T>
  T get() {
    T value{};
    if (const char* from = take(sizeof value)) std::memcpy(&value, from, sizeof value);
    return value;
  }
  std::string get_text() {
    const auto size = get<std::uint64_t>();
    const char* from = take(size);
    return from ? std::string(from, size) : std::string();
  }
  bool ok() const { return ok_; }
  bool at_end() const { return bytes_.empty(); }

 private:
  const char* take(std::size_t size) {
    if (!ok_ || size > bytes_.size()) {
      ok_ = false;
      return nullptr;
    }
    const char* from = bytes_.data();
    bytes_.remove_prefix(size);
    return from;
  }
  std::string_view bytes_;
  bool ok_ = true;
};

struct Box {
  std::int32_t top, left, rows, columns;
};

std::uint8_t flags_at(const FrameFeatures& f, Eigen::Index row, Eigen::Index column) {
  return static_cast<std::uint8_t>(f.angles.valid(row, column) | f.fold_mask(row, column) << 1 |
                                   f.silhouette(row, column) << 2);
}

/// Of the pixels that hold anything.
Box bounding_box(const FrameFeatures& f) {
  Eigen::Index top = f.silhouette.rows(), left = f.silhouette.cols(), bottom = 0, right = 0;
  for (Eigen::Index row = 0; row < f.silhouette.rows(); ++row)
    for (Eigen::Index column = 0; column < f.silhouette.cols(); ++column) {
      if (flags_at(f, row, column) == 0) continue;
      top = std::min(top, row);
      left = std::min(left, column);
      bottom = std::max(bottom, row + 1);
      right = std::max(right, column + 1);
    }
  if (bottom == 0) return {0, 0, 0, 0};
  return {int(top), int(left), int(bottom - top), int(right - left)};
}

void put_frame(Writer& out, const FrameFeatures& f) {
  const Box box = bounding_box(f);
  out.put(box);
  for (int row = box.top; row < box.top + box.rows; ++row)
    for (int column = box.left; column < box.left + box.columns; ++column) {
      out.put(flags_at(f, row, column));
      if (f.angles.valid(row, column)) out.put(f.angles.angle(row, column));
    }
  out.put(static_cast<std::uint64_t>(f.phase.size()));
  for (const PhaseSample& sample : f.phase) out.put(sample);
}

bool get_frame(Reader& in, int height, int width, FrameFeatures& f) {
  f.angles.angle = Image::Zero(height, width);
  f.angles.valid = f.fold_mask = f.silhouette = Mask::Zero(height, width);
  const auto box = in.get<Box>();
  const bool inside = box.top >= 0 && box.left >= 0 && box.rows >= 0 && box.columns >= 0 &&
                      box.rows <= height - box.top && box.columns <= width - box.left;
  if (!in.ok() || !inside) return false;
  for (int row = box.top; row < box.top + box.rows; ++row)
    for (int column = box.left; column < box.left + box.columns; ++column) {
      const auto flags = in.get<std::uint8_t>();
      f.angles.valid(row, column) = flags & 1;
      f.fold_mask(row, column) = flags >> 1 & 1;
      f.silhouette(row, column) = flags >> 2 & 1;
      if (flags & 1) f.angles.angle(row, column) = in.get<float>();
    }
  const auto samples = in.get<std::uint64_t>();
  if (samples > static_cast<std::uint64_t>(height) * static_cast<std::uint64_t>(width))
    return false;
  f.phase.resize(samples);
  for (PhaseSample& sample : f.phase) sample = in.get<PhaseSample>();
  return in.ok();
}

std::uint64_t checksum(std::string_view bytes) {
  ContentHash hash;
  hash.add(bytes);
  return hash.value();
}

}  // namespace

std::filesystem::path cache_file(const std::filesystem::path& folder, const Capture& capture,
                                 const std::string& key) {
  std::string name;
  for (const char c : capture.name)
    if (std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-') name += c;
  return folder / fmt::format("{}-{}.features", name.substr(0, 64), key);
}

bool read_cached(const std::filesystem::path& file, const std::string& key, Trial& trial) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return false;
  const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  std::string_view body = bytes;
  if (!body.starts_with(kMagic) || body.size() < kMagic.size() + 8) return false;
  std::uint64_t sum;
  std::memcpy(&sum, body.data() + body.size() - 8, 8);
  body.remove_suffix(8);
  if (sum != checksum(body)) return false;

  Reader in(body.substr(kMagic.size()));
  if (in.get_text() != key) return false;
  std::string start_name = in.get_text(), start_note = in.get_text();
  const auto residual = in.get<double>();
  std::vector<Points> starts(std::min<std::size_t>(in.get<std::uint32_t>(), kMostStarts),
                             Points(3, trial.scene.mesh.vertex_count()));
  if (starts.empty() || in.get<std::int32_t>() != starts.front().cols()) return false;
  for (Points& start : starts)
    for (double& coordinate : start.reshaped()) coordinate = in.get<double>();
  const std::size_t count =
      trial.scene.frame_times.size() - static_cast<std::size_t>(trial.first_frame);
  if (in.get<std::uint64_t>() != count) return false;
  std::vector<FrameFeatures> features(count);
  for (FrameFeatures& frame : features)
    if (!get_frame(in, trial.capture.rig.height, trial.capture.rig.width, frame)) return false;
  if (!in.at_end()) return false;

  trial.start_name = std::move(start_name);
  trial.start_note = std::move(start_note);
  trial.start_residual = residual;
  trial.scene.start = std::move(starts.front());
  trial.other_starts.assign(std::make_move_iterator(starts.begin() + 1),
                            std::make_move_iterator(starts.end()));
  trial.features = std::move(features);
  return true;
}

void write_cached(const std::filesystem::path& file, const std::string& key, const Trial& trial) {
  Writer out;
  out.put_text(key);
  out.put_text(trial.start_name);
  out.put_text(trial.start_note);
  out.put(trial.start_residual);
  out.put(static_cast<std::uint32_t>(1 + trial.other_starts.size()));
  out.put(static_cast<std::int32_t>(trial.scene.start.cols()));
  for (const double coordinate : trial.scene.start.reshaped()) out.put(coordinate);
  for (const Points& start : trial.other_starts)
    for (const double coordinate : start.reshaped()) out.put(coordinate);
  out.put(static_cast<std::uint64_t>(trial.features.size()));
  for (const FrameFeatures& frame : trial.features) put_frame(out, frame);
  const std::string body = std::string(kMagic) + out.bytes();
  const std::uint64_t sum = checksum(body);

  std::error_code code;
  std::filesystem::create_directories(file.parent_path(), code);
  std::filesystem::path temporary = file;
  temporary += fmt::format(".{}.part", ::getpid());
  std::ofstream stream(temporary, std::ios::binary);
  stream.write(body.data(), static_cast<std::streamsize>(body.size()));
  stream.write(reinterpret_cast<const char*>(&sum), sizeof sum);
  stream.close();
  if (stream) std::filesystem::rename(temporary, file, code);
  if (!stream || code) {
    std::filesystem::remove(temporary, code);
    throw Error(fmt::format("{}: cannot be written", file.string()));
  }
}

}  // namespace weft
