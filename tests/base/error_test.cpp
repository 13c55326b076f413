#include "weft/base/error.h"

#include <gtest/gtest.h>

namespace weft::error_test {
namespace {

TEST(ErrorAt, NamesFileLineKeyAndReason) {
  EXPECT_STREQ(error_at({"a/b.toml", 12, "swatch.width"}, "missing").what(),
               "a/b.toml:12: swatch.width: missing");
}

TEST(ErrorAt, LeavesOutWhatItDoesNotHave) {
  EXPECT_STREQ(error_at({"a.obj", 0, ""}, "no vertices").what(), "a.obj: no vertices");
  EXPECT_STREQ(error_at({"a.obj", 3, ""}, "bad").what(), "a.obj:3: bad");
  EXPECT_STREQ(error_at({"", 0, "--seed"}, "bad").what(), "--seed: bad");
  EXPECT_STREQ(error_at({}, "bad").what(), "bad");
}

}  // namespace
}  // namespace weft::error_test
