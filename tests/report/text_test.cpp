#include "weft/report/text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "weft/base/types.h"

namespace weft::text_test {
namespace {

TEST(Text, EscapesWhatMarkupWouldTake) {
  EXPECT_EQ(escape_xml("<b>&\"'"), "&lt;b&gt;&amp;&quot;&#39;");
  EXPECT_EQ(escape_xml("a\tb\nc"), "a\tb\nc");
}

TEST(Text, LeavesOutControlCharactersAndReplacesBadUtf8) {
  EXPECT_EQ(escape_xml(std::string("a\x01\x00z", 4)), "az");
  EXPECT_EQ(escape_xml("é · 𝄞"), "é · 𝄞");
  EXPECT_EQ(escape_xml("\xE9t"), "\uFFFDt");                    // Latin-1
  EXPECT_EQ(escape_xml("\xC0\xAF"), "\uFFFD\uFFFD");            // overlong "/"
  EXPECT_EQ(escape_xml("\xED\xA0\x80"), "\uFFFD\uFFFD\uFFFD");  // a surrogate
  EXPECT_EQ(escape_xml("\xF0\x9D"), "\uFFFD\uFFFD");            // cut off
}

TEST(Text, NumbersForPeople) {
  EXPECT_EQ(format_value(0), "0");
  EXPECT_EQ(format_value(412.3), "412");
  EXPECT_EQ(format_value(1234.5), "1234");
  EXPECT_EQ(format_value(-0.0123), "−0.0123");
  EXPECT_EQ(format_value(3.214e-5), "3.21×10⁻⁵");
  EXPECT_EQ(format_value(2.5e6, 2), "2.5×10⁶");
  EXPECT_EQ(format_value(kInfinity), "∞");
  EXPECT_EQ(format_value(-kInfinity), "−∞");
  EXPECT_EQ(format_value(std::nan("")), "not a number");
}

TEST(Text, RoundingCarriesIntoTheNextPowerOfTen) {
  EXPECT_EQ(format_value(9.996), "10.0");
  EXPECT_EQ(format_value(0.0009996), "0.00100");
  EXPECT_EQ(format_value(999999.9), "1.00×10⁶");
}

TEST(Text, ShortNumbersDropZerosOfTheFractionOnly) {
  EXPECT_EQ(format_short(0.5), "0.5");
  EXPECT_EQ(format_short(10), "10");
  EXPECT_EQ(format_short(1000), "1000");
  EXPECT_EQ(format_short(1e-7), "1×10⁻⁷");
  EXPECT_EQ(format_short(2.5e-7), "2.5×10⁻⁷");
  EXPECT_EQ(format_short(kInfinity), "∞");
}

TEST(Text, Units) {
  EXPECT_EQ(format_unit("N m"), "N·m");
  EXPECT_EQ(format_unit("N s^2/m^4"), "N·s²/m⁴");
  EXPECT_EQ(format_unit(""), "");
}

TEST(Text, Durations) {
  EXPECT_EQ(format_duration(0.42), "0.42 s");
  EXPECT_EQ(format_duration(200.2), "3 min 20 s");
  EXPECT_EQ(format_duration(7500), "2 h 05 min");
}

TEST(Text, CsvFieldsFollowRfc4180) {
  EXPECT_EQ(csv_field("plain"), "plain");
  EXPECT_EQ(csv_field("a,b"), "\"a,b\"");
  EXPECT_EQ(csv_field("say \"hi\""), "\"say \"\"hi\"\"\"");
}

TEST(Text, CsvNumbersReadBackExactly) {
  for (const double value : {0.1, 1.0 / 3, 1e-300, -2.5e17, 5e-324}) {
    EXPECT_EQ(std::strtod(csv_number(value).c_str(), nullptr), value);
  }
  EXPECT_EQ(csv_number(kInfinity), "inf");
  EXPECT_EQ(csv_number(-std::nan("")), "nan");
}

TEST(Text, Base64TestVectorsOfRfc4648) {
  const auto encode = [](const std::string& s) {
    return base64(std::vector<std::uint8_t>(s.begin(), s.end()));
  };
  EXPECT_EQ(encode(""), "");
  EXPECT_EQ(encode("f"), "Zg==");
  EXPECT_EQ(encode("fo"), "Zm8=");
  EXPECT_EQ(encode("foo"), "Zm9v");
  EXPECT_EQ(encode("foobar"), "Zm9vYmFy");
  EXPECT_EQ(encode("\xFF\xFE\xFD"), "//79");
}

}  // namespace
}  // namespace weft::text_test
