#include "weft/base/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

namespace weft::progress_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// What a Progress prints to a stream that is no terminal.
class ProgressTest : public ::testing::Test {
 protected:
  std::string text() {
    std::rewind(file_.get());
    std::string result(4096, '\0');
    result.resize(std::fread(result.data(), 1, result.size(), file_.get()));
    return result;
  }
  Progress::Options options() { return {.stream = file_.get()}; }

  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_{std::tmpfile(), std::fclose};
};

TEST_F(ProgressTest, InALogPrintsAtMostOneLineAnInterval) {
  {
    Progress progress("fit", 100, options());
    for (std::size_t i = 1; i <= 100; ++i) progress.update(i, "error 0.5");
  }
  const std::string printed = text();
  // The first update and the last line; the rest fell within 10 s of the first.
  EXPECT_EQ(std::count(printed.begin(), printed.end(), '\n'), 2) << printed;
  EXPECT_THAT(printed, HasSubstr("fit: 1/100"));
  EXPECT_THAT(printed, HasSubstr("left"));
  EXPECT_THAT(printed, HasSubstr("error 0.5"));
  EXPECT_THAT(printed, HasSubstr("fit: 100/100 in "));
  EXPECT_THAT(printed, Not(HasSubstr("\r")));
}

TEST_F(ProgressTest, FinishesOnce) {
  {
    Progress progress("fit", 3, options());
    progress.update(2);
    progress.finish("stopped");
    progress.update(3);
  }
  const std::string printed = text();
  EXPECT_THAT(printed, HasSubstr("fit: 2/3 in 0 s, stopped\n"));
  EXPECT_EQ(std::count(printed.begin(), printed.end(), '\n'), 2) << printed;
}

TEST_F(ProgressTest, QuietPrintsNothing) {
  {
    Progress::Options quiet = options();
    quiet.quiet = true;
    Progress progress("fit", 3, quiet);
    progress.update(1);
  }
  EXPECT_EQ(text(), "");
}

}  // namespace
}  // namespace weft::progress_test
