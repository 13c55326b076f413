#include "weft/report/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/utf8.h"

namespace weft {
namespace {

constexpr std::string_view kMinus = "\u2212";
constexpr std::string_view kReplacement = "\uFFFD";

std::string with_minus_sign(std::string text) {
  if (!text.empty() && text.front() == '-') text.replace(0, 1, kMinus);
  return text;
}

std::string superscript(int number) {
  static constexpr std::string_view kDigits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string result;
  for (const char c : std::to_string(number)) {
    result += c == '-' ? std::string_view("⁻") : kDigits[static_cast<std::size_t>(c - '0')];
  }
  return result;
}

}  // namespace

std::string escape_xml(std::string_view text) {
  std::string result;
  result.reserve(text.size() + 16);
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (length == 0) {
      result += kReplacement;
      text.remove_prefix(1);
      continue;
    }
    const char c = text[0];
    if (length > 1) {
      // U+FFFE and U+FFFF are valid UTF-8 and no XML characters.
      const std::string_view sequence = text.substr(0, length);
      result +=
          (sequence == "\xEF\xBF\xBE" || sequence == "\xEF\xBF\xBF") ? kReplacement : sequence;
    } else if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '"') {
      result += "&quot;";
    } else if (c == '\'') {
      result += "&#39;";
    } else if (static_cast<unsigned char>(c) >= 0x20 || c == '\t' || c == '\n' || c == '\r') {
      result += c;
    }
    text.remove_prefix(length);
  }
  return result;
}

std::string power_of_ten(int exponent) {
  return exponent == 0 ? "1" : "10" + superscript(exponent);
}

std::string format_value(double value, int digits) {
  if (std::isnan(value)) return "not a number";
  if (std::isinf(value)) return value > 0 ? "∞" : std::string(kMinus) + "∞";
  if (value == 0) return "0";
  digits = std::clamp(digits, 1, 17);
  // Rounding may carry into the next power of ten: ask the rounded number.
  const std::string scientific = fmt::format("{:.{}e}", value, digits - 1);
  const std::size_t e = scientific.find('e');
  const int exponent = std::stoi(scientific.substr(e + 1));
  if (exponent < -3 || exponent >= 6) {
    return with_minus_sign(scientific.substr(0, e)) + "×10" + superscript(exponent);
  }
  return with_minus_sign(fmt::format("{:.{}f}", value, std::max(0, digits - 1 - exponent)));
}

std::string format_short(double value, int digits) {
  std::string text = format_value(value, digits);
  const std::size_t end = std::min(text.find("×"), text.size());
  const std::string_view mantissa = std::string_view(text).substr(0, end);
  if (mantissa.find('.') == std::string_view::npos) return text;
  std::size_t kept = mantissa.find_last_not_of('0');
  if (mantissa[kept] != '.') ++kept;
  return text.erase(kept, end - kept);
}

std::string format_unit(std::string_view unit) {
  std::string result;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    if (unit[i] == ' ') {
      result += "·";
    } else if (unit[i] == '^' && i + 1 < unit.size() && unit[i + 1] >= '0' && unit[i + 1] <= '9') {
      result += superscript(unit[++i] - '0');
    } else {
      result += unit[i];
    }
  }
  return result;
}

std::string in_words(std::string name) {
  std::ranges::replace(name, '_', ' ');
  return name;
}

std::string format_duration(double seconds) {
  if (!std::isfinite(seconds)) return format_value(seconds) + " s";
  if (seconds < 99.5) return format_value(seconds, seconds < 10 ? 2 : 3) + " s";
  const long whole = std::lround(seconds);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

std::string csv_field(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"') result += '"';
    result += c;
  }
  return result + '"';
}

std::string csv_number(double value) {
  if (std::isnan(value)) return "nan";
  return fmt::format("{}", value);
}

std::string base64(std::span<const std::uint8_t> bytes) {
  static constexpr char kAlphabet[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  result.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) {
      result += k <= count ? kAlphabet[group >> (18 - 6 * k) & 63] : '=';
    }
  }
  return result;
}

}  // namespace weft
