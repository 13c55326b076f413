#include "weft/base/json_text.h"

#include <fmt/format.h>

#include <algorithm>

#include "weft/base/error.h"

namespace weft {
namespace {

using Json = nlohmann::ordered_json;

/// Keeps nothing but where and why reading ends: exceptions of numbers do not say where.
class JsonFailure : public nlohmann::json_sax<Json> {
 public:
  std::size_t byte = 0;
  std::string token;
  bool out_of_range = false;

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_object(std::size_t) override { return true; }
  bool key(string_t&) override { return true; }
  bool end_object() override { return true; }
  bool start_array(std::size_t) override { return true; }
  bool end_array() override { return true; }
  bool parse_error(std::size_t position, const std::string& last_token,
                   const Json::exception& error) override {
    byte = position;
    token = last_token;
    out_of_range = dynamic_cast<const Json::out_of_range*>(&error) != nullptr;
    return false;
  }
};

/// 1-based line of a byte position.
int line_at(std::string_view text, std::size_t byte) {
  return 1 +
         static_cast<int>(std::ranges::count(text.substr(0, std::min(byte, text.size())), '\n'));
}

Error failure_in(std::string_view text, const std::filesystem::path& name, bool comments) {
  JsonFailure failure;
  Json::sax_parse(text, &failure, Json::input_format_t::json, true, comments);
  return error_at({name, line_at(text, failure.byte), {}},
                  failure.out_of_range ? fmt::format("{} is too large for a number", failure.token)
                                       : "is not JSON");
}

}  // namespace

nlohmann::ordered_json parse_json(std::string_view text, const std::filesystem::path& name,
                                  JsonComments comments) {
  const bool passed_over = comments == JsonComments::passed_over;
  try {
    return Json::parse(text, nullptr, true, passed_over);
  } catch (const Json::exception&) {
    throw failure_in(text, name, passed_over);
  }
}

}  // namespace weft
