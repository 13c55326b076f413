#include "weft/base/utf8.h"

#include <gtest/gtest.h>

namespace weft::utf8_test {
namespace {

TEST(Utf8, TakesEachLengthAtItsEnds) {
  for (const char* text : {"", "plain", "caf\u00e9", "\u0080\u07ff", "\u0800\ud7ff\ue000\uffff",
                           "\U00010000\U0010ffff"})
    EXPECT_TRUE(is_utf8(text)) << text;
}

TEST(Utf8, RefusesWhatReadersOfJsonAndTomlRefuse) {
  for (const char* text : {
           "caf\xe9",           // Latin-1
           "\xe9t\xe9",         // of it, a letter where a byte of the character should be
           "\xc3",              // cut short
           "\xe2\x82",          //
           "\xf0\x9f\x98",      //
           "\xa9",              // the rest of one
           "\xc0\xaf",          // '/' in two bytes
           "\xe0\x9f\xbf",      // U+07FF in three
           "\xf0\x8f\xbf\xbf",  // U+FFFF in four
           "\xed\xa0\x80",      // half of a pair of UTF-16
           "\xf4\x90\x80\x80",  // U+110000
           "\xff",
       })
    EXPECT_FALSE(is_utf8(text)) << utf8_escaped(text);
}

TEST(Utf8, EscapesOnlyWhatIsNone) {
  EXPECT_EQ(utf8_escaped("caf\xe9/\u00e9.toml"), "caf\\xe9/\u00e9.toml");
  EXPECT_EQ(utf8_escaped("\xe2\x82"), "\\xe2\\x82");
}

}  // namespace
}  // namespace weft::utf8_test
