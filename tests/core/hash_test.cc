// SPDX-License-Identifier: BSD-3-Clause
#include "core/hash.h"

#include <gtest/gtest.h>

namespace adasfm {
namespace {

// The values that the authors of FNV publish.
TEST(Fnv1aHash, IsTheOneOfItsAuthors) {
  EXPECT_EQ(Fnv1aHash().Value(), 0xcbf29ce484222325ull);
  Fnv1aHash one;
  one.AddBytes("a", 1);
  EXPECT_EQ(one.Text(), "af63dc4c8601ec8c");
  Fnv1aHash word;
  word.AddBytes("foo", 3);
  word.AddBytes("bar", 3);
  EXPECT_EQ(word.Value(), 0x85944171f73967e8ull);
}

TEST(Fnv1aHash, TellsNumbersOfAnotherTypeApart) {
  Fnv1aHash a;
  a.Add(1);
  Fnv1aHash b;
  b.Add(1.0);
  EXPECT_NE(a.Value(), b.Value());
}

}  // namespace
}  // namespace adasfm
