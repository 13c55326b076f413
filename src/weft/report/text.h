#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace weft {

/// Text made safe inside XML and HTML elements and quoted attributes: the five special characters
/// are escaped, control characters other than tab and line ends are left out, and bytes that are
/// not valid UTF-8 become U+FFFD.
std::string escape_xml(std::string_view text);

/// A number for people: `digits` significant digits (1 to 17), powers of ten as "1.23×10⁻⁵" below
/// 1e-3 and from 1e6 on, "∞", "−∞" and "not a number" for what is not finite.
std::string format_value(double value, int digits = 3);

/// The same without zeros at the end of the fraction: "0.5", "2.5×10⁻⁷".
std::string format_short(double value, int digits = 4);

/// "10⁻³" for -3; "1" for 0.
std::string power_of_ten(int exponent);

/// A unit as it is printed: "N s^2/m^4" becomes "N·s²/m⁴".
std::string format_unit(std::string_view unit);

/// The name of a parameter as it is printed: "bend_stiffness" becomes "bend stiffness".
std::string in_words(std::string name);

/// A duration, s, in the largest fitting units: "0.42 s", "3 min 20 s", "2 h 05 min".
std::string format_duration(double seconds);

/// A field of a CSV file (RFC 4180): quoted where it holds a comma, a quote or a line end.
std::string csv_field(std::string_view text);
/// A number that reads back to the same double; "inf", "-inf" and "nan" for what is not finite.
std::string csv_number(double value);

/// Base 64 with padding (RFC 4648, section 4).
std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace weft
