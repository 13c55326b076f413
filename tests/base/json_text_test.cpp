#include "weft/base/json_text.h"

#include <gtest/gtest.h>

#include "weft/base/error.h"

namespace weft::json_text_test {
namespace {

std::string refusal(const std::string& text) {
  try {
    parse_json(text, "a.json");
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(JsonText, ComesInTheOrderOfTheFile) {
  EXPECT_EQ(parse_json(R"({"b": 1, "a": [2.5]})", "a.json").dump(), R"({"b":1,"a":[2.5]})");
}

TEST(JsonText, CommentsArePassedOverWhereAsked) {
  const std::string text = "// made up\n{\"a\": 1}";
  EXPECT_EQ(parse_json(text, "a.json", JsonComments::passed_over)["a"], 1);
  EXPECT_EQ(refusal(text), "a.json:1: is not JSON");
}

TEST(JsonText, ErrorsHaveTheLine) {
  EXPECT_EQ(refusal("{\n\"a\": }"), "a.json:2: is not JSON");
  EXPECT_EQ(refusal(""), "a.json:1: is not JSON");
  EXPECT_EQ(refusal("{\"a\": \"caf\xe9\"}"), "a.json:1: is not JSON");
  EXPECT_EQ(refusal("{\"a\": 1,\n\n\"b\": [-1e999]}"),
            "a.json:3: -1e999 is too large for a number");
}

}  // namespace
}  // namespace weft::json_text_test
