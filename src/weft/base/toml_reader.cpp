#include "weft/base/toml_reader.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <set>
#include <utility>

namespace weft {
namespace {

std::string_view type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "an integer";
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "a boolean";
    case toml::node_type::date:
    case toml::node_type::time:
    case toml::node_type::date_time:
      return "a date or time";
    default:
      return "nothing";
  }
}

std::string range_text(Range range) {
  if (range.lower == -kInfinity && range.upper == kInfinity) return "any finite number";
  if (range.upper == kInfinity) return fmt::format("at least {:g}", range.lower);
  if (range.lower == -kInfinity) return fmt::format("at most {:g}", range.upper);
  return fmt::format("in [{:g}, {:g}]", range.lower, range.upper);
}

std::string list_text(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "\"" : ", \"") + word + "\"";
  }
  return text;
}

/// Edit distance in which a swap of two neighbours counts as one (optimal string alignment): the
/// commonest typing mistake is then as near as a single wrong letter.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  const std::size_t columns = b.size() + 1;
  std::vector<std::size_t> table((a.size() + 1) * columns);
  auto at = [&](std::size_t i, std::size_t j) -> std::size_t& { return table[i * columns + j]; };
  for (std::size_t i = 0; i <= a.size(); ++i) at(i, 0) = i;
  for (std::size_t j = 0; j <= b.size(); ++j) at(0, j) = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = a[i - 1] == b[j - 1] ? 0 : 1;
      at(i, j) = std::min({at(i - 1, j) + 1, at(i, j - 1) + 1, at(i - 1, j - 1) + change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        at(i, j) = std::min(at(i, j), at(i - 2, j - 2) + 1);
      }
    }
  }
  return table.back();
}

/// The candidate nearest to `word`, or empty if even that one shares too little with it: half of
/// the letters may differ.
std::string nearest(std::string_view word, const std::set<std::string, std::less<>>& candidates) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(word.size() / 2, 1) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

int line_of(const toml::source_region& source) { return static_cast<int>(source.begin.line); }

}  // namespace

struct TomlTable::Impl {
  std::shared_ptr<const toml::table> root;  ///< owns `table`
  const toml::table* table = nullptr;
  std::filesystem::path file;
  std::string name;  ///< dotted path of this table, empty for the file itself
  std::set<std::string, std::less<>> read;   ///< keys that were read or ignored
  std::set<std::string, std::less<>> known;  ///< keys that were asked for: candidates for hints

  std::string full(std::string_view key) const {
    if (name.empty()) return std::string(key);
    return key.empty() ? name : name + "." + std::string(key);
  }

  SourceLocation location(std::string_view key) const {
    for (const auto& [name_of_key, node] : *table) {
      if (name_of_key.str() == key) return {file, line_of(name_of_key.source()), full(key)};
    }
    // The table of a whole file starts nowhere in particular.
    return {file, name.empty() ? 0 : line_of(table->source()), full(key)};
  }

  SourceLocation location(std::string_view key, const toml::node& node) const {
    return {file, line_of(node.source()), full(key)};
  }

  const toml::node* find(std::string_view key) {
    known.emplace(key);
    read.emplace(key);
    return table->get(key);
  }

  const toml::node& require(std::string_view key) {
    const toml::node* node = find(key);
    if (node == nullptr) throw missing(key);
    return *node;
  }

  Error missing(std::string_view key) const {
    std::set<std::string, std::less<>> unread;
    for (const auto& [other, node] : *table) {
      if (!read.contains(other.str())) unread.emplace(other.str());
    }
    const std::string similar = nearest(key, unread);
    if (similar.empty()) return error_at(location(key), "missing");
    return error_at(location(key), fmt::format("missing (is it \"{}\" on line {}?)", similar,
                                               location(similar).line));
  }

  Error wrong_type(const SourceLocation& where, std::string_view expected,
                   const toml::node& node) const {
    return error_at(where, fmt::format("expected {}, found {}", expected, type_name(node)));
  }

  double number(std::string_view key, const toml::node& node, Range valid) const {
    if (!node.is_number()) throw wrong_type(location(key, node), "a number", node);
    const double value = *node.value<double>();
    if (!std::isfinite(value)) {
      throw error_at(location(key, node), fmt::format("{} is not a finite number", value));
    }
    if (value < valid.lower || value > valid.upper) {
      throw error_at(location(key, node),
                     fmt::format("{:g} is out of range; must be {}", value, range_text(valid)));
    }
    return value;
  }

  int integer(std::string_view key, const toml::node& node, int lower, int upper) const {
    if (!node.is_integer()) throw wrong_type(location(key, node), "an integer", node);
    const std::int64_t value = *node.value<std::int64_t>();
    if (value < lower || value > upper) {
      throw error_at(location(key, node),
                     fmt::format("{} is out of range; must be in [{}, {}]", value, lower, upper));
    }
    return static_cast<int>(value);
  }

  std::string string(std::string_view key, const toml::node& node) const {
    if (!node.is_string()) throw wrong_type(location(key, node), "a string", node);
    return *node.value<std::string>();
  }

  bool boolean(std::string_view key, const toml::node& node) const {
    if (!node.is_boolean()) throw wrong_type(location(key, node), "true or false", node);
    return *node.value<bool>();
  }

  std::string choice(std::string_view key, const toml::node& node,
                     const std::vector<std::string>& choices) const {
    std::string value = string(key, node);
    if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
      throw error_at(location(key, node),
                     fmt::format("\"{}\" is not valid; must be {}{}", value,
                                 choices.size() > 1 ? "one of " : "", list_text(choices)));
    }
    return value;
  }

  const toml::array& array(std::string_view key, const toml::node& node, std::size_t count,
                           std::string_view of) const {
    const std::string expected = fmt::format("an array of {} {}", count, of);
    if (!node.is_array()) throw wrong_type(location(key, node), expected, node);
    const toml::array& values = *node.as_array();
    if (values.size() != count) {
      throw error_at(location(key, node),
                     fmt::format("expected {}, found {}", expected, values.size()));
    }
    return values;
  }

  std::string element(std::string_view key, std::size_t index) const {
    return fmt::format("{}[{}]", key, index);
  }

  TomlTable child(std::string_view key, const toml::table& table_of_key) const {
    auto impl = std::make_shared<Impl>();
    impl->root = root;
    impl->table = &table_of_key;
    impl->file = file;
    impl->name = full(key);
    return TomlTable(std::move(impl));
  }
};

namespace {

toml::table parse(std::string_view text, const std::filesystem::path& name) {
  try {
    return toml::parse(text, name.string());
  } catch (const toml::parse_error& error) {
    throw error_at({name, line_of(error.source()), {}}, error.description());
  }
}

std::string read_text(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::exists(path, status)) throw error_at({path, 0, {}}, "no such file");
  if (!std::filesystem::is_regular_file(path, status)) throw error_at({path, 0, {}}, "not a file");
  std::ifstream stream(path, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (!stream) throw error_at({path, 0, {}}, "cannot be read");
  return text;
}

}  // namespace

TomlTable::TomlTable(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

TomlTable TomlTable::parse_file(const std::filesystem::path& path) {
  return parse_string(read_text(path), path);
}

TomlTable TomlTable::parse_string(std::string_view text, const std::filesystem::path& name) {
  auto root = std::make_shared<const toml::table>(parse(text, name));
  auto impl = std::make_shared<Impl>();
  impl->table = root.get();
  impl->root = std::move(root);
  impl->file = name;
  return TomlTable(std::move(impl));
}

bool TomlTable::has(std::string_view key) const {
  impl_->known.emplace(key);
  return impl_->table->contains(key);
}

std::vector<std::string> TomlTable::keys() const {
  std::vector<std::pair<int, std::string>> lines;
  for (const auto& [key, node] : *impl_->table) {
    lines.emplace_back(line_of(key.source()), key.str());
  }
  std::stable_sort(lines.begin(), lines.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> result;
  for (auto& [line, key] : lines) result.push_back(std::move(key));
  return result;
}

const std::filesystem::path& TomlTable::file() const { return impl_->file; }

SourceLocation TomlTable::where(std::string_view key) const { return impl_->location(key); }

double TomlTable::number(std::string_view key, Range valid) const {
  return impl_->number(key, impl_->require(key), valid);
}

int TomlTable::integer(std::string_view key, int lower, int upper) const {
  return impl_->integer(key, impl_->require(key), lower, upper);
}

bool TomlTable::boolean(std::string_view key) const {
  return impl_->boolean(key, impl_->require(key));
}

std::string TomlTable::string(std::string_view key) const {
  return impl_->string(key, impl_->require(key));
}

std::string TomlTable::choice(std::string_view key, const std::vector<std::string>& choices) const {
  return impl_->choice(key, impl_->require(key), choices);
}

std::vector<double> TomlTable::numbers(std::string_view key, std::size_t count, Range valid) const {
  const toml::array& values = impl_->array(key, impl_->require(key), count, "numbers");
  std::vector<double> result;
  for (std::size_t i = 0; i < count; ++i) {
    result.push_back(impl_->number(impl_->element(key, i), *values.get(i), valid));
  }
  return result;
}

std::vector<int> TomlTable::integers(std::string_view key, std::size_t count, int lower,
                                     int upper) const {
  const toml::array& values = impl_->array(key, impl_->require(key), count, "integers");
  std::vector<int> result;
  for (std::size_t i = 0; i < count; ++i) {
    result.push_back(impl_->integer(impl_->element(key, i), *values.get(i), lower, upper));
  }
  return result;
}

std::vector<std::string> TomlTable::strings(std::string_view key, std::size_t count) const {
  const toml::array& values = impl_->array(key, impl_->require(key), count, "strings");
  std::vector<std::string> result;
  for (std::size_t i = 0; i < count; ++i) {
    result.push_back(impl_->string(impl_->element(key, i), *values.get(i)));
  }
  return result;
}

std::size_t TomlTable::array_size(std::string_view key, std::size_t lower,
                                  std::size_t upper) const {
  const toml::node& node = impl_->require(key);
  if (!node.is_array()) throw impl_->wrong_type(impl_->location(key, node), "an array", node);
  const std::size_t size = node.as_array()->size();
  if (size < lower || size > upper)
    throw error_at(impl_->location(key, node),
                   fmt::format("{} entries; must be {} to {}", size, lower, upper));
  return size;
}

bool TomlTable::is_array(std::string_view key) const {
  return has(key) && impl_->table->get(key)->is_array();
}

MatX TomlTable::matrix(std::string_view key, int rows, int columns) const {
  const toml::node& node = impl_->require(key);
  const auto row_count = static_cast<std::size_t>(rows);
  const auto column_count = static_cast<std::size_t>(columns);
  const toml::array& outer =
      impl_->array(key, node, row_count, fmt::format("rows of {} numbers", columns));
  MatX result(rows, columns);
  for (std::size_t i = 0; i < row_count; ++i) {
    const std::string row_key = impl_->element(key, i);
    const toml::array& row = impl_->array(row_key, *outer.get(i), column_count, "numbers");
    for (std::size_t j = 0; j < column_count; ++j) {
      result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          impl_->number(impl_->element(row_key, j), *row.get(j), {-kInfinity, kInfinity});
    }
  }
  return result;
}

TomlTable TomlTable::table(std::string_view key) const {
  const toml::node& node = impl_->require(key);
  if (!node.is_table()) throw impl_->wrong_type(impl_->location(key), "a table", node);
  return impl_->child(key, *node.as_table());
}

std::vector<TomlTable> TomlTable::tables(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  if (node == nullptr) return {};
  if (!node->is_array()) throw impl_->wrong_type(impl_->location(key), "an array of tables", *node);
  std::vector<TomlTable> result;
  for (const toml::node& element : *node->as_array()) {
    const std::string name = impl_->element(key, result.size());
    if (!element.is_table())
      throw impl_->wrong_type(impl_->location(name, element), "a table", element);
    result.push_back(impl_->child(name, *element.as_table()));
  }
  return result;
}

std::optional<double> TomlTable::optional_number(std::string_view key, Range valid) const {
  const toml::node* node = impl_->find(key);
  return node ? std::optional(impl_->number(key, *node, valid)) : std::nullopt;
}

std::optional<int> TomlTable::optional_integer(std::string_view key, int lower, int upper) const {
  const toml::node* node = impl_->find(key);
  return node ? std::optional(impl_->integer(key, *node, lower, upper)) : std::nullopt;
}

std::optional<bool> TomlTable::optional_boolean(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  return node ? std::optional(impl_->boolean(key, *node)) : std::nullopt;
}

std::optional<std::string> TomlTable::optional_string(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  return node ? std::optional(impl_->string(key, *node)) : std::nullopt;
}

std::optional<std::string> TomlTable::optional_choice(
    std::string_view key, const std::vector<std::string>& choices) const {
  const toml::node* node = impl_->find(key);
  return node ? std::optional(impl_->choice(key, *node, choices)) : std::nullopt;
}

std::optional<TomlTable> TomlTable::optional_table(std::string_view key) const {
  if (impl_->find(key) == nullptr) return std::nullopt;
  return table(key);
}

void TomlTable::ignore(std::string_view key) const { impl_->find(key); }

void TomlTable::finish() const {
  for (const std::string& key : keys()) {
    if (impl_->read.contains(key)) continue;
    std::set<std::string, std::less<>> candidates;
    for (const std::string& known : impl_->known) {
      if (!impl_->table->contains(known)) candidates.insert(known);
    }
    std::string hint = nearest(key, candidates);
    // Every similar key stands in the file already: name the nearest of those instead.
    if (hint.empty()) hint = nearest(key, impl_->known);
    throw error_at(where(key), hint.empty()
                                   ? std::string("unknown key")
                                   : fmt::format("unknown key; did you mean \"{}\"?", hint));
  }
}

}  // namespace weft
