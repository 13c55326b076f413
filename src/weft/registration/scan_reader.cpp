#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <opencv2/core.hpp>
#include <optional>
#include <string_view>

#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/base/number_text.h"
#include "weft/mesh/mesh_io.h"
#include "weft/registration/scan.h"
#include "weft/vision/codecs.h"

namespace weft {
namespace {

namespace fs = std::filesystem;

std::string read_all(const fs::path& path) {
  std::error_code status;
  if (!fs::exists(path, status)) throw error_at({path, 0, {}}, "no such file");
  std::ifstream stream(path, std::ios::binary);
  if (!stream || fs::is_directory(path, status)) throw error_at({path, 0, {}}, "cannot be read");
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

std::string ending_of(const fs::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

std::string_view without_mark(std::string_view text) {
  constexpr std::string_view mark = "\xEF\xBB\xBF";  // of UTF-8
  if (text.starts_with(mark)) text.remove_prefix(mark.size());
  return text;
}

bool is_list(const std::string& ending) {
  return ending == ".xyz" || ending == ".txt" || ending == ".pts" || ending == ".csv";
}

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view gaps = " \t\r,;";
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t begin = line.find_first_not_of(gaps);
    if (begin == std::string_view::npos) return words;
    line.remove_prefix(begin);
    const std::size_t end = std::min(line.find_first_of(gaps), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

std::optional<double> signed_number(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  return number_of<double>(word);
}

/// Lines of a text, counted.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}
  bool next(std::string_view& line) {
    if (text_.empty()) return false;
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    line = text_.substr(0, end);
    text_.remove_prefix(std::min(end + 1, text_.size()));
    ++number_;
    return true;
  }
  int number() const { return number_; }

 private:
  std::string_view text_;
  int number_ = 0;
};

/// Collects points and brings them into a scan.
struct PointList {
  std::vector<Vec3> position;
  std::vector<Eigen::Vector3f> colour;

  Scan scan() const {
    Scan scan;
    scan.position.resize(3, static_cast<Eigen::Index>(position.size()));
    for (std::size_t i = 0; i < position.size(); ++i) {
      scan.position.col(static_cast<Eigen::Index>(i)) = position[i];
    }
    if (colour.size() != position.size()) return scan;
    scan.colour.resize(3, scan.position.cols());
    for (std::size_t i = 0; i < colour.size(); ++i) {
      scan.colour.col(static_cast<Eigen::Index>(i)) = colour[i];
    }
    // Bytes, unless all of them would be fractions.
    if (scan.colour.cols() > 0 && scan.colour.maxCoeff() > 1) scan.colour /= 255;
    return scan;
  }
};

/// The numbers of a line; empty for a blank line and a comment.
std::vector<double> line_numbers(std::string_view line, const fs::path& path, int number) {
  std::vector<double> numbers;
  for (const std::string_view word : words_of(line)) {
    if (numbers.empty() && word.front() == '#') return {};
    const auto value = signed_number(word);
    if (!value) {
      throw error_at({path, number, {}}, fmt::format("\"{}\" is not a number", word));
    }
    numbers.push_back(*value);
  }
  return numbers;
}

constexpr auto kNone = static_cast<std::size_t>(-1);

/// Which numbers of a line are what.
struct ListColumns {
  std::size_t count = 0;  ///< of a line; 0: no header says it
  std::array<std::size_t, 3> position{0, 1, 2};
  std::array<std::size_t, 3> colour{kNone, kNone, kNone};

  bool coloured() const { return std::count(colour.begin(), colour.end(), kNone) == 0; }
};

/// Letters only, small.
std::string plain_name(std::string_view word) {
  std::string name;
  for (const char c : word)
    if (std::isalpha(static_cast<unsigned char>(c)))
      name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

/// What a header names; nothing without x, y and z.
std::optional<ListColumns> columns_of(const std::vector<std::string_view>& header) {
  const auto place = [&](std::initializer_list<std::string_view> names) {
    for (std::size_t k = 0; k < header.size(); ++k)
      if (std::count(names.begin(), names.end(), plain_name(header[k]))) return k;
    return kNone;
  };
  ListColumns columns;
  columns.count = header.size();
  columns.position = {place({"x"}), place({"y"}), place({"z"})};
  columns.colour = {place({"r", "red"}), place({"g", "green"}), place({"b", "blue"})};
  if (std::count(columns.position.begin(), columns.position.end(), kNone)) return {};
  return columns;
}

/// Points of a list, from its first line.
class ListReader {
 public:
  explicit ListReader(const fs::path& path)
      : path_(path), text_(read_all(path)), lines_(without_mark(text_)) {}

  Scan read() {
    std::string_view line;
    while (lines_.next(line)) {
      if (list_.position.empty() && is_header(line))
        read_header(line);
      else
        read_point(line_numbers(line, path_, lines_.number()));
    }
    return list_.scan();
  }

 private:
  static bool is_header(std::string_view line) {
    const auto words = words_of(line);
    return !words.empty() && words[0].front() != '#' && !signed_number(words[0]);
  }

  /// Titles are passed over, but for a CSV: its header says what its columns are.
  void read_header(std::string_view line) {
    if (const auto columns = columns_of(words_of(line)))
      columns_ = *columns;
    else if (ending_of(path_) == ".csv")
      throw error_at({path_, lines_.number(), {}},
                     fmt::format("the header \"{}\" has no columns x, y and z",
                                 line.substr(0, line.find('\r'))));
  }

  void read_point(const std::vector<double>& numbers) {
    if (numbers.empty()) return;
    // A lone number is a count of points, as PTS files begin with.
    if (numbers.size() == 1 && list_.position.empty() && columns_.count == 0) return;
    check_count(numbers.size());
    list_.position.push_back(vector_at(numbers, columns_.position));
    if (columns_.coloured()) {
      list_.colour.push_back(vector_at(numbers, columns_.colour).cast<float>());
    } else if (columns_.count == 0 && numbers.size() >= 6) {
      // PTS: x y z intensity red green blue.
      const std::size_t first = numbers.size() - 3;
      list_.colour.push_back(vector_at(numbers, {first, first + 1, first + 2}).cast<float>());
    }
  }

  /// Without a header only these counts say what the numbers are.
  void check_count(std::size_t count) {
    if (columns_.count > 0) {
      if (count != columns_.count)
        throw error_at({path_, lines_.number(), {}},
                       fmt::format("{} numbers, {} columns", count, columns_.count));
      return;
    }
    if (count != 3 && count != 6 && count != 7)
      throw error_at(
          {path_, lines_.number(), {}},
          fmt::format("{} numbers; without a header that names x, y and z a point has 3, "
                      "6 with its colour, or 7 with intensity and colour",
                      count));
    if (first_count_ == 0) first_count_ = count;
    if (count != first_count_)
      throw error_at({path_, lines_.number(), {}},
                     fmt::format("{} numbers, {} in the lines before", count, first_count_));
  }

  Vec3 vector_at(const std::vector<double>& numbers, const std::array<std::size_t, 3>& at) const {
    const Vec3 v(numbers[at[0]], numbers[at[1]], numbers[at[2]]);
    if (!v.allFinite()) throw error_at({path_, lines_.number(), {}}, "a number that is not finite");
    return v;
  }

  fs::path path_;
  std::string text_;
  Lines lines_;
  ListColumns columns_;
  std::size_t first_count_ = 0;  ///< of the first point, without a header
  PointList list_;
};

// --- OBJ: what read_obj does not read ---

/// The picture that the first map_Kd of a material file names; empty if there is none.
fs::path picture_of(const fs::path& material) {
  const std::string text = read_all(material);
  Lines lines(text);
  std::string_view line;
  fs::path picture;
  while (lines.next(line)) {
    const auto words = words_of(line);
    if (words.size() < 2 || words[0] != "map_Kd") continue;
    const fs::path named = material.parent_path() / std::string(words.back());
    if (!picture.empty() && named != picture) {
      throw error_at({material, lines.number(), "map_Kd"}, "a second picture; one is read");
    }
    picture = named;
  }
  return picture;
}

void read_picture(const fs::path& path, ScanTexture& texture) {
  const cv::Mat picture = codecs().read_picture(path.string(), PictureChannels::colour);
  if (picture.empty()) throw error_at({path, 0, {}}, "cannot be read as a picture");
  texture.width = picture.cols;
  texture.height = picture.rows;
  texture.pixels.resize(3, static_cast<Eigen::Index>(picture.total()));
  for (int i = 0; i < picture.rows; ++i) {
    for (int j = 0; j < picture.cols; ++j) {
      const cv::Vec3b& bgr = picture.at<cv::Vec3b>(i, j);
      texture.pixels.col(i * picture.cols + j) = Eigen::Vector3f(bgr[2], bgr[1], bgr[0]) / 255;
    }
  }
}

/// Colours of the vertices, and a texture, of an OBJ whose geometry has been read and is sound.
void add_obj_colours(const fs::path& path, Scan& scan) {
  const std::string text = read_all(path);
  Lines lines(text);
  std::string_view line;
  std::vector<Eigen::Vector3f> colours;
  std::vector<Vec2> textures;
  ScanTexture texture;
  fs::path picture;
  bool complete = true;
  while (lines.next(line)) {
    const auto words = words_of(line);
    if (words.empty()) continue;
    const auto number = [&](std::size_t k) {
      return k < words.size() ? signed_number(words[k]).value_or(0) : 0.0;
    };
    if (words[0] == "v" && words.size() >= 7) {
      colours.push_back(Vec3(number(4), number(5), number(6)).cast<float>());
    } else if (words[0] == "vt") {
      textures.emplace_back(number(1), number(2));
    } else if (words[0] == "mtllib" && words.size() >= 2 && picture.empty()) {
      const fs::path material = path.parent_path() / std::string(words[1]);
      std::error_code status;
      if (fs::exists(material, status)) picture = picture_of(material);
    } else if (words[0] == "f") {
      std::vector<Vec2> corners;
      for (std::size_t k = 1; k < words.size(); ++k) {
        const std::size_t slash = words[k].find('/');
        std::string_view index = slash == std::string_view::npos ? "" : words[k].substr(slash + 1);
        index = index.substr(0, index.find('/'));
        const double value = signed_number(index).value_or(0);
        const double at = value < 0 ? static_cast<double>(textures.size()) + value : value - 1;
        const bool valid = at >= 0 && at < static_cast<double>(textures.size());
        complete = complete && valid;
        corners.push_back(valid ? textures[static_cast<std::size_t>(at)] : Vec2(Vec2::Zero()));
      }
      for (std::size_t k = 2; k < corners.size(); ++k) {
        texture.corners.push_back({corners[0], corners[k - 1], corners[k]});
      }
    }
  }
  if (static_cast<int>(colours.size()) == scan.size()) {
    scan.colour.resize(3, scan.size());
    for (std::size_t i = 0; i < colours.size(); ++i) {
      scan.colour.col(static_cast<Eigen::Index>(i)) = colours[i];
    }
    if (scan.colour.maxCoeff() > 1) scan.colour /= 255;
  }
  if (picture.empty() || !complete || texture.corners.size() != scan.triangles.size()) return;
  read_picture(picture, texture);
  scan.texture = std::move(texture);
}

// --- PLY ---

enum class PlyFormat { ascii, little, big };

struct PlyProperty {
  std::string name, type, count_type;  ///< count_type: empty unless it is a list
};
struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
};

class PlyReader {
 public:
  explicit PlyReader(const fs::path& path) : path_(path), text_(read_all(path)) {}

  Scan read() {
    read_header();
    for (const PlyElement& element : elements_) read_element(element);
    check_end();
    Scan scan = list_.scan();
    for (const auto& triangle : triangles_) {
      for (const int vertex : triangle) {
        if (vertex < 0 || vertex >= scan.size()) {
          throw error_at({path_, 0, {}},
                         fmt::format("a face names vertex {}; there are {}", vertex, scan.size()));
        }
      }
    }
    scan.triangles = std::move(triangles_);
    return scan;
  }

 private:
  /// With the line that is being read, where there are lines.
  Error fail(std::string_view reason) const {
    if (format_ != PlyFormat::ascii) return error_at({path_, 0, {}}, reason);
    const auto read = text_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, text_.size()));
    // What ends a line belongs to it.
    const auto last = read == text_.begin() ? read : read - 1;
    return error_at({path_, 1 + static_cast<int>(std::count(text_.begin(), last, '\n')), {}},
                    reason);
  }

  /// Nothing is left but blanks: else the counts of the header are not those of the data.
  void check_end() {
    const std::size_t more = text_.find_first_not_of(" \t\r\n", at_);
    if (more == std::string::npos) return;
    at_ = more + 1;
    std::string counts;
    for (const PlyElement& element : elements_)
      counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", element.count, element.name);
    throw fail(fmt::format("data after the elements that the header declares: {}", counts));
  }

  std::string_view header_line() {
    const std::size_t end = text_.find('\n', at_);
    if (end == std::string::npos) throw fail("the header of a PLY file has no end_header");
    std::string_view line(text_.data() + at_, end - at_);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    at_ = end + 1;
    return line;
  }

  void read_header() {
    if (text_.find('\n') == std::string::npos || header_line() != "ply") {
      throw fail("not a PLY file (no \"ply\" in its first line)");
    }
    bool known = false;
    while (true) {
      const std::string_view line = header_line();
      const auto words = words_of(line);
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "format" && words.size() >= 2) {
        if (words.size() != 3 || words[2] != "1.0")
          throw fail(fmt::format("\"{}\": the version must be 1.0", line));
        known = true;
        if (words[1] == "ascii")
          format_ = PlyFormat::ascii;
        else if (words[1] == "binary_little_endian")
          format_ = PlyFormat::little;
        else if (words[1] == "binary_big_endian")
          format_ = PlyFormat::big;
        else
          known = false;
      } else if (words[0] == "element" && words.size() == 3) {
        const double count = signed_number(words[2]).value_or(-1);
        if (!(count >= 0) || count > 2e9) throw fail(fmt::format("\"{}\": not a count", line));
        elements_.push_back({std::string(words[1]), static_cast<std::int64_t>(count), {}});
      } else if (words[0] == "property" && words.size() >= 3 && !elements_.empty()) {
        const bool is_list_property = words[1] == "list" && words.size() == 5;
        if (!is_list_property && words.size() != 3)
          throw fail(fmt::format("\"{}\" in the header is not understood", line));
        check_type(words[words.size() - 2]);
        if (is_list_property) check_type(words[2]);
        elements_.back().properties.push_back(
            {std::string(words.back()), std::string(words[words.size() - 2]),
             is_list_property ? std::string(words[2]) : std::string()});
      } else {
        throw fail(fmt::format("\"{}\" in the header is not understood", line));
      }
    }
    if (!known) throw fail("the format must be ascii, binary_little_endian or binary_big_endian");
  }

  void check_type(std::string_view type) const {
    constexpr std::array<std::string_view, 16> known{
        "float",  "float32", "double", "float64", "uchar", "uint8",  "char", "int8",
        "ushort", "uint16",  "short",  "int16",   "uint",  "uint32", "int",  "int32"};
    if (std::find(known.begin(), known.end(), type) == known.end())
      throw fail(fmt::format("type \"{}\" is not understood", type));
  }

  template <class Value>
  double binary() {
    if (at_ + sizeof(Value) > text_.size()) throw fail("cut short");
    char bytes[sizeof(Value)];
    std::memcpy(bytes, text_.data() + at_, sizeof(Value));
    if (format_ == PlyFormat::big) std::reverse(bytes, bytes + sizeof(Value));
    at_ += sizeof(Value);
    Value value;
    std::memcpy(&value, bytes, sizeof(Value));
    return static_cast<double>(value);
  }

  double word() {
    constexpr std::string_view gaps = " \t\r\n";
    const std::size_t begin = text_.find_first_not_of(gaps, at_);
    if (begin == std::string::npos) throw fail("cut short");
    at_ = std::min(text_.find_first_of(gaps, begin), text_.size());
    const std::string_view word(text_.data() + begin, at_ - begin);
    const auto value = signed_number(word);
    if (!value) throw fail(fmt::format("\"{}\" is not a number", word));
    return *value;
  }

  double number(const std::string& type) {
    if (format_ == PlyFormat::ascii) return word();
    if (type == "float" || type == "float32") return binary<float>();
    if (type == "double" || type == "float64") return binary<double>();
    if (type == "uchar" || type == "uint8") return binary<std::uint8_t>();
    if (type == "char" || type == "int8") return binary<std::int8_t>();
    if (type == "ushort" || type == "uint16") return binary<std::uint16_t>();
    if (type == "short" || type == "int16") return binary<std::int16_t>();
    if (type == "uint" || type == "uint32") return binary<std::uint32_t>();
    if (type == "int" || type == "int32") return binary<std::int32_t>();
    throw fail(fmt::format("type \"{}\" is not understood", type));
  }

  void read_element(const PlyElement& element) {
    const bool vertices = element.name == "vertex", faces = element.name == "face";
    const auto place = [&](std::string_view name) {
      const auto& all = element.properties;
      const auto found = std::find_if(all.begin(), all.end(),
                                      [&](const PlyProperty& p) { return p.name == name; });
      return found == all.end() ? kNone : static_cast<std::size_t>(found - all.begin());
    };
    const std::array<std::size_t, 3> at{place("x"), place("y"), place("z")};
    const std::array<std::size_t, 3> colour_at{place("red"), place("green"), place("blue")};
    if (vertices && std::count(at.begin(), at.end(), kNone)) throw fail("vertices need x, y and z");
    const bool coloured = !std::count(colour_at.begin(), colour_at.end(), kNone);
    std::vector<double> values(element.properties.size());
    for (std::int64_t k = 0; k < element.count; ++k) {
      for (std::size_t p = 0; p < values.size(); ++p) {
        const PlyProperty& property = element.properties[p];
        if (property.count_type.empty()) {
          values[p] = number(property.type);
        } else {
          read_property_list(property, faces && property.name.starts_with("vertex_ind"));
        }
      }
      if (!vertices) continue;
      const Vec3 position(values[at[0]], values[at[1]], values[at[2]]);
      if (!position.allFinite()) throw fail(fmt::format("vertex {} is not finite", k));
      list_.position.push_back(position);
      if (!coloured) continue;
      list_.colour.push_back(
          Vec3(values[colour_at[0]], values[colour_at[1]], values[colour_at[2]]).cast<float>());
    }
  }

  void read_property_list(const PlyProperty& property, bool face) {
    const double count = number(property.count_type);
    if (!(count >= 0) || count > 1e6 || count != std::floor(count))
      throw fail(fmt::format(
          "a list of {} entries: are the counts of the header those of the data?", count));
    std::vector<int> corners;
    for (int i = 0; i < static_cast<int>(count); ++i) {
      const double value = number(property.type);
      if (face) corners.push_back(std::abs(value) < 2e9 ? static_cast<int>(value) : -1);
    }
    for (std::size_t i = 2; i < corners.size(); ++i) {
      triangles_.push_back({corners[0], corners[i - 1], corners[i]});
    }
  }

  fs::path path_;
  std::string text_;
  std::size_t at_ = 0;
  PlyFormat format_ = PlyFormat::ascii;
  std::vector<PlyElement> elements_;
  PointList list_;
  std::vector<std::array<int, 3>> triangles_;
};

Scan finish(Scan scan, double unit, const fs::path& path) {
  if (scan.size() == 0) throw error_at({path, 0, {}}, "no points");
  scan.position *= unit;
  return scan;
}

void check_unit(double unit) {
  if (!(unit > 0 && unit < 1e6)) throw Error(fmt::format("unit {} m: must be above 0", unit));
}

std::vector<Scan> read_pcseq(const fs::path& path, double unit) {
  static_assert(std::endian::native == std::endian::little);
  const std::string bytes = read_all(path);
  std::size_t at = 0;
  const auto next = [&]<class Value>(Value& value) {
    if (at + sizeof(Value) > bytes.size()) throw error_at({path, 0, {}}, "cut short");
    std::memcpy(&value, bytes.data() + at, sizeof(Value));
    at += sizeof(Value);
  };
  std::int32_t frames = 0;
  next(frames);
  if (frames < 1) throw error_at({path, 0, {}}, fmt::format("{} frames", frames));
  std::vector<Scan> scans;
  for (std::int32_t k = 0; k < frames; ++k) {
    std::int32_t count = 0;
    next(count);
    if (count < 0 || static_cast<std::size_t>(count) > (bytes.size() - at) / 6) {
      throw error_at({path, 0, {}}, fmt::format("frame {} is cut short", k));
    }
    Scan scan;
    scan.position.resize(3, count);
    for (std::int32_t i = 0; i < count; ++i) {
      std::array<std::int16_t, 3> xyz{};
      next(xyz);
      for (int axis = 0; axis < 3; ++axis) {
        scan.position(axis, i) = xyz[static_cast<std::size_t>(axis)];
      }
    }
    scans.push_back(finish(std::move(scan), unit, path));
  }
  if (at != bytes.size()) throw error_at({path, 0, {}}, "longer than its frames");
  return scans;
}

/// The words of the first line that is neither blank nor a comment.
std::vector<std::string_view> header_of(Lines& lines) {
  std::string_view line;
  while (lines.next(line)) {
    auto words = words_of(line);
    if (!words.empty() && words[0].front() != '#') return words;
  }
  return {};
}

bool is_sequence(std::string_view text) {
  Lines lines(text);
  const auto header = header_of(lines);
  return std::ranges::any_of(header, [](auto word) { return plain_name(word) == "frame"; });
}

/// A CSV with a column `frame`.
std::vector<Scan> read_frames_csv(const fs::path& path, std::string_view text, double unit) {
  std::vector<PointList> frames;
  Lines lines(text);
  std::string_view line;
  const auto header = header_of(lines);
  const auto place = [&](const char* name) {
    const auto found = std::ranges::find(header, name, plain_name);
    if (found == header.end())
      throw error_at({path, lines.number(), name}, "a sequence needs the columns frame, x, y, z");
    return static_cast<std::size_t>(found - header.begin());
  };
  const std::size_t frame_at = place("frame"), x = place("x"), y = place("y"), z = place("z");
  while (lines.next(line)) {
    const auto numbers = line_numbers(line, path, lines.number());
    if (numbers.empty()) continue;
    if (numbers.size() != header.size()) {
      throw error_at({path, lines.number(), {}},
                     fmt::format("{} numbers, {} columns", numbers.size(), header.size()));
    }
    const double frame = numbers[frame_at];
    const auto last = static_cast<double>(frames.size()) - 1;
    if (frame != last && frame != last + 1) {
      throw error_at({path, lines.number(), "frame"},
                     fmt::format("{} after {}: frames count 0, 1, 2 ...", frame, last));
    }
    if (frame > last) frames.emplace_back();
    const Vec3 p(numbers[x], numbers[y], numbers[z]);
    if (!p.allFinite()) throw error_at({path, lines.number(), {}}, "a position that is not finite");
    frames.back().position.push_back(p);
  }
  std::vector<Scan> scans;
  for (const PointList& frame : frames) scans.push_back(finish(frame.scan(), unit, path));
  if (scans.empty()) throw error_at({path, 0, {}}, "no points");
  return scans;
}

}  // namespace

Scan read_scan(const fs::path& path, double unit) {
  check_unit(unit);
  const std::string ending = ending_of(path);
  if (ending == ".ply") return finish(PlyReader(path).read(), unit, path);
  if (is_list(ending)) return finish(ListReader(path).read(), unit, path);
  if (ending == ".obj") {
    ObjMesh mesh = read_obj(path);
    Scan scan;
    scan.position = std::move(mesh.positions);
    scan.triangles = std::move(mesh.triangles);
    add_obj_colours(path, scan);
    return finish(std::move(scan), unit, path);
  }
  throw error_at({path, 0, {}}, "a scan is .ply, .obj, .xyz, .txt, .pts or .csv");
}

std::vector<Scan> read_scans(const fs::path& path, double unit) {
  check_unit(unit);
  if (is_folder(path)) {
    std::vector<fs::path> files;
    for (const fs::path& entry : entries_of(path)) {
      const std::string ending = ending_of(entry);
      if (ending == ".ply" || ending == ".obj" || is_list(ending)) files.push_back(entry);
    }
    std::sort(files.begin(), files.end());
    if (files.empty()) throw error_at({path, 0, {}}, "a folder without scans");
    std::vector<Scan> scans;
    for (const fs::path& file : files) {
      if (ending_of(file) != ending_of(files.front())) {
        throw error_at({file, 0, {}},
                       fmt::format("scans of a sequence have one ending; {} is there, too",
                                   files.front().filename().string()));
      }
      scans.push_back(read_scan(file, unit));
    }
    return scans;
  }
  if (ending_of(path) == ".pcseq") return read_pcseq(path, unit);
  if (ending_of(path) == ".csv") {
    const std::string text = read_all(path);
    if (is_sequence(without_mark(text))) return read_frames_csv(path, without_mark(text), unit);
  }
  std::vector<Scan> scans;
  scans.push_back(read_scan(path, unit));
  return scans;
}

}  // namespace weft
