#include "weft/base/number_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

namespace weft::number_text_test {
namespace {

TEST(NumberText, IsAllOfTheText) {
  EXPECT_EQ(number_of<double>("-1.5e-3"), -1.5e-3);
  EXPECT_EQ(number_of<int>("12"), 12);
  EXPECT_TRUE(std::isinf(*number_of<double>("inf")));
  for (const char* text : {"", " 1", "1 ", "+1", "1m", "m", "1,2", "0x10"})
    EXPECT_FALSE(number_of<double>(text)) << text;
  EXPECT_FALSE(number_of<int>("1.5"));
  EXPECT_FALSE(number_of<std::uint64_t>("-1"));
  EXPECT_FALSE(number_of<double>("1e999"));
}

TEST(NumberText, ListsHaveNothingBesideNumbersAndSeparators) {
  EXPECT_EQ(numbers_of("1.5,2,-3e4", ','), (std::vector<double>{1.5, 2, -3e4}));
  EXPECT_EQ(numbers_of("0.3x0.4", 'x'), (std::vector<double>{0.3, 0.4}));
  EXPECT_EQ(numbers_of("7", ','), std::vector<double>{7});
  for (const char* text : {"", ",", "1,", ",1", "1,,2", "1, 2", "1;2", "1,x", "1,nan", "inf"})
    EXPECT_FALSE(numbers_of(text, ',')) << text;
}

}  // namespace
}  // namespace weft::number_text_test
