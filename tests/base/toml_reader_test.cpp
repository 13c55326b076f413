#include "weft/base/toml_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace weft::toml_reader_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TomlTable parse(std::string_view text) { return TomlTable::parse_string(text, "f.toml"); }

/// The message of the Error that `read` throws for `text`.
template <typename Read>
std::string message(std::string_view text, Read read) {
  try {
    read(parse(text));
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

constexpr Range kAny{-std::numeric_limits<double>::infinity(),
                     std::numeric_limits<double>::infinity()};

TEST(TomlTable, ReadsEveryKindOfValue) {
  const TomlTable file = parse(
      "n = 0.5\nwhole = 3\nflag = true\ntext = \"a\"\nlist = [1, 2.5]\ncounts = [1, 2]\n"
      "words = [\"p\", \"q\"]\nm = [[1, 2, 3], [4, 5.5, 6]]\n[sub]\nx = 1\n[[item]]\ny = 1\n"
      "[[item]]\ny = 2\n");
  EXPECT_EQ(file.number("n", {0, 1}), 0.5);
  EXPECT_EQ(file.number("whole", {0, 10}), 3.0);
  EXPECT_EQ(file.integer("whole", 0, 10), 3);
  EXPECT_TRUE(file.boolean("flag"));
  EXPECT_EQ(file.string("text"), "a");
  EXPECT_EQ(file.choice("text", {"b", "a"}), "a");
  EXPECT_EQ(file.numbers("list", 2, kAny), (std::vector<double>{1, 2.5}));
  EXPECT_EQ(file.integers("counts", 2, 0, 5), (std::vector<int>{1, 2}));
  EXPECT_EQ(file.strings("words", 2), (std::vector<std::string>{"p", "q"}));
  EXPECT_EQ(file.matrix("m", 2, 3), (MatX(2, 3) << 1, 2, 3, 4, 5.5, 6).finished());
  const TomlTable sub = file.table("sub");
  EXPECT_EQ(sub.number("x", kAny), 1);
  EXPECT_NO_THROW(sub.finish());
  const std::vector<TomlTable> items = file.tables("item");
  ASSERT_EQ(items.size(), 2u);
  EXPECT_EQ(items[1].number("y", kAny), 2);
  EXPECT_NO_THROW(file.finish());
}

TEST(TomlTable, OptionalValuesMayBeAbsentButNotWrong) {
  const TomlTable file = parse("a = 1\nb = true\nc = \"x\"\n[t]\n");
  EXPECT_EQ(file.optional_number("a", {0, 2}), 1.0);
  EXPECT_EQ(file.optional_integer("a", 0, 2), 1);
  EXPECT_EQ(file.optional_boolean("b"), true);
  EXPECT_EQ(file.optional_string("c"), "x");
  EXPECT_EQ(file.optional_choice("c", {"x"}), "x");
  EXPECT_TRUE(file.optional_table("t").has_value());
  EXPECT_FALSE(file.optional_number("z", {0, 2}).has_value());
  EXPECT_FALSE(file.optional_integer("z", 0, 2).has_value());
  EXPECT_FALSE(file.optional_boolean("z").has_value());
  EXPECT_FALSE(file.optional_string("z").has_value());
  EXPECT_FALSE(file.optional_choice("z", {"x"}).has_value());
  EXPECT_FALSE(file.optional_table("z").has_value());
  EXPECT_TRUE(file.tables("z").empty());
  EXPECT_THROW(file.optional_number("b", {0, 2}), Error);
  EXPECT_THROW(file.optional_integer("a", 2, 3), Error);
  EXPECT_THROW(file.optional_boolean("a"), Error);
  EXPECT_THROW(file.optional_string("a"), Error);
  EXPECT_THROW(file.optional_choice("c", {"y"}), Error);
  EXPECT_THROW(file.optional_table("a"), Error);
}

TEST(TomlTable, MissingKeyNamesFileTableLineAndKey) {
  const auto read = [](const TomlTable& file) { file.table("swatch").number("width", kAny); };
  EXPECT_EQ(message("a = 1\n\n[swatch]\nheight = 1\n", read), "f.toml:3: swatch.width: missing");
  EXPECT_EQ(message("a = 1\n", read), "f.toml: swatch: missing");
}

TEST(TomlTable, MissingKeyPointsAtAMisspelledOne) {
  EXPECT_EQ(message("[swatch]\nwidht = 1\n",
                    [](const TomlTable& file) { file.table("swatch").number("width", kAny); }),
            "f.toml:1: swatch.width: missing (is it \"widht\" on line 2?)");
}

TEST(TomlTable, UnknownKeyNamesItsLineAndTheNearestKnownKey) {
  EXPECT_EQ(message("[camera]\nwidth = 1\n\ndistorsion = 2\n",
                    [](const TomlTable& file) {
                      const TomlTable camera = file.table("camera");
                      camera.integer("width", 0, 9);
                      camera.optional_number("height", kAny);
                      camera.optional_number("distortion", kAny);
                      camera.finish();
                    }),
            "f.toml:4: camera.distorsion: unknown key; did you mean \"distortion\"?");
}

TEST(TomlTable, UnknownKeyFarFromAnyOtherHasNoHint) {
  EXPECT_EQ(message("width = 1\ncolour = 2\n",
                    [](const TomlTable& file) {
                      file.integer("width", 0, 9);
                      file.finish();
                    }),
            "f.toml:2: colour: unknown key");
}

TEST(TomlTable, FinishNamesTheFirstUnknownKeyInTheFile) {
  EXPECT_THAT(message("b = 1\na = 2\n", [](const TomlTable& file) { file.finish(); }),
              StartsWith("f.toml:1: b: unknown key"));
}

TEST(TomlTable, UnknownTablesAndTablesOfArraysAreFoundToo) {
  EXPECT_THAT(message("a = 1\n[extra]\nb = 1\n",
                      [](const TomlTable& file) {
                        file.integer("a", 0, 1);
                        file.finish();
                      }),
              StartsWith("f.toml:2: extra: unknown key"));
  EXPECT_THAT(message("[[item]]\ny = 1\n[[item]]\ny = 1\nz = 1\n",
                      [](const TomlTable& file) {
                        for (const TomlTable& item : file.tables("item")) {
                          item.integer("y", 0, 1);
                          item.finish();
                        }
                      }),
              StartsWith("f.toml:5: item[1].z: unknown key"));
}

TEST(TomlTable, HasDoesNotCountAsReadButIgnoreDoes) {
  const TomlTable file = parse("a = 1\n");
  EXPECT_TRUE(file.has("a"));
  EXPECT_FALSE(file.has("b"));
  EXPECT_THROW(file.finish(), Error);
  file.ignore("a");
  EXPECT_NO_THROW(file.finish());
}

TEST(TomlTable, WrongTypesAreNamed) {
  const auto number = [](const TomlTable& file) { file.number("a", kAny); };
  EXPECT_EQ(message("a = \"1\"", number), "f.toml:1: a: expected a number, found a string");
  EXPECT_THAT(message("a = [1]", number), HasSubstr("expected a number, found an array"));
  EXPECT_THAT(message("a = 2020-01-01", number), HasSubstr("expected a number, found a date"));
  EXPECT_THAT(message("a = true", number), HasSubstr("expected a number, found a boolean"));
  EXPECT_THAT(message("a = 1.0", [](const TomlTable& t) { t.integer("a", 0, 1); }),
              HasSubstr("expected an integer, found a number"));
  EXPECT_THAT(message("a = 1", [](const TomlTable& t) { t.boolean("a"); }),
              HasSubstr("expected true or false, found an integer"));
  EXPECT_THAT(message("a = 1", [](const TomlTable& t) { t.string("a"); }),
              HasSubstr("expected a string, found an integer"));
  EXPECT_THAT(message("a = 1", [](const TomlTable& t) { t.table("a"); }),
              HasSubstr("expected a table, found an integer"));
  EXPECT_THAT(message("[a]", [](const TomlTable& t) { t.tables("a"); }),
              HasSubstr("expected an array of tables, found a table"));
}

TEST(TomlTable, NanAndInfinityAreRejectedEverywhere) {
  for (const char* bad : {"nan", "inf", "-inf"}) {
    const std::string text =
        std::string("a = ") + bad + "\nb = [1, " + bad + "]\nc = [[1], [" + bad + "]]\n";
    EXPECT_THAT(message(text, [](const TomlTable& t) { t.number("a", kAny); }),
                AllOf(StartsWith("f.toml:1: a: "), HasSubstr("not a finite number")));
    EXPECT_THAT(message(text, [](const TomlTable& t) { t.numbers("b", 2, kAny); }),
                AllOf(StartsWith("f.toml:2: b[1]: "), HasSubstr("not a finite number")));
    EXPECT_THAT(message(text, [](const TomlTable& t) { t.matrix("c", 2, 1); }),
                AllOf(StartsWith("f.toml:3: c[1][0]: "), HasSubstr("not a finite number")));
  }
}

TEST(TomlTable, OutOfRangeGivesTheValueAndTheValidRange) {
  EXPECT_EQ(message("a = 12",
                    [](const TomlTable& t) {
                      t.number("a", {0.001, 10});
                    }),
            "f.toml:1: a: 12 is out of range; must be in [0.001, 10]");
  EXPECT_THAT(message("a = -1",
                      [](const TomlTable& t) {
                        t.number("a", {0, kAny.upper});
                      }),
              HasSubstr("must be at least 0"));
  EXPECT_THAT(message("a = 1",
                      [](const TomlTable& t) {
                        t.number("a", {kAny.lower, 0});
                      }),
              HasSubstr("must be at most 0"));
  EXPECT_THAT(message("a = 5000000000", [](const TomlTable& t) { t.integer("a", 0, 100); }),
              HasSubstr("5000000000 is out of range; must be in [0, 100]"));
  EXPECT_THAT(message("a = [1, 7]", [](const TomlTable& t) { t.integers("a", 2, 0, 5); }),
              HasSubstr("a[1]: 7 is out of range"));
  EXPECT_EQ(message("a = \"zz\"",
                    [](const TomlTable& t) {
                      t.choice("a", {"x", "y"});
                    }),
            "f.toml:1: a: \"zz\" is not valid; must be one of \"x\", \"y\"");
  // The bounds themselves are valid.
  EXPECT_NO_THROW(parse("a = 10").number("a", {0, 10}));
  EXPECT_NO_THROW(parse("a = 10").integer("a", 10, 10));
}

TEST(TomlTable, WrongShapesSayWhatWasExpectedAndFound) {
  EXPECT_EQ(message("a = [1, 2]", [](const TomlTable& t) { t.numbers("a", 3, kAny); }),
            "f.toml:1: a: expected an array of 3 numbers, found 2");
  const auto matrix = [](const TomlTable& t) { t.matrix("m", 3, 4); };
  EXPECT_EQ(message("m = [[1, 2, 3, 4], [1, 2, 3, 4]]", matrix),
            "f.toml:1: m: expected an array of 3 rows of 4 numbers, found 2");
  EXPECT_EQ(message("m = [[1, 2, 3, 4],\n[1, 2, 3],\n[1, 2, 3, 4]]", matrix),
            "f.toml:2: m[1]: expected an array of 4 numbers, found 3");
  EXPECT_THAT(message("m = [1, 2, 3]", matrix),
              HasSubstr("m[0]: expected an array of 4 numbers, found an integer"));
  EXPECT_THAT(message("m = 1", matrix), HasSubstr("expected an array of 3 rows of 4 numbers"));
}

TEST(TomlTable, ArraysOfAnyLengthSayHowLongTheyAre) {
  const TomlTable file = TomlTable::parse_string("a = [1, 2, 3]\nb = 1\n", "f.toml");
  EXPECT_TRUE(file.is_array("a"));
  EXPECT_FALSE(file.is_array("b"));
  EXPECT_FALSE(file.is_array("c"));
  EXPECT_EQ(file.array_size("a", 1, 3), 3);
  EXPECT_EQ(message("a = [1, 2, 3]\n", [](const TomlTable& t) { t.array_size("a", 1, 2); }),
            "f.toml:1: a: 3 entries; must be 1 to 2");
  EXPECT_THAT(message("a = 1\n", [](const TomlTable& t) { t.array_size("a", 1, 2); }),
              StartsWith("f.toml:1: a: expected an array"));
}

TEST(TomlTable, SyntaxErrorsHaveALine) {
  EXPECT_THAT(message("a = 1\nb = = 2\n", [](const TomlTable&) {}), StartsWith("f.toml:2: "));
  EXPECT_THAT(message("a = 1\na = 2\n", [](const TomlTable&) {}), StartsWith("f.toml:2: "));
}

TEST(TomlTable, ErrorsAreOneLine) {
  EXPECT_THAT(message("a = \"\n\"\n", [](const TomlTable&) {}), Not(HasSubstr("\n")));
}

TEST(TomlTable, AMissingFileIsNamed) {
  try {
    TomlTable::parse_file("/no/such/file.toml");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "/no/such/file.toml: no such file");
  }
  EXPECT_THROW(TomlTable::parse_file("/tmp"), Error);
}

TEST(TomlTable, KeysComeInTheOrderOfTheFile) {
  EXPECT_EQ(parse("z = 1\na = 2\nm = 3\n").keys(), (std::vector<std::string>{"z", "a", "m"}));
}

TEST(TomlTable, WhereGivesFileLineAndFullKey) {
  const TomlTable sub = parse("a = 1\n[s]\n\nx = 2\n").table("s");
  EXPECT_EQ(sub.where("x").line, 4);
  EXPECT_EQ(sub.where("x").key, "s.x");
  EXPECT_EQ(sub.where("absent").line, 2);
  EXPECT_EQ(sub.where().line, 2);
  EXPECT_EQ(sub.file(), "f.toml");
}

}  // namespace
}  // namespace weft::toml_reader_test
