// Oracle: HTML ends a script at the next `</script`, and opens a comment at `<!--`, whatever stands around
// it.
#include "handsim/output/report/page.h"

#include <gtest/gtest.h>

#include "handsim/core/error.h"

namespace handsim::output {
namespace {

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t out = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++out;
  return out;
}

TEST(Page, StringsCannotEndItsScripts) {
  const std::string hostile = "</script><script>alert(1)</script><!-- {{scripts}} {{data}}";
  const std::string plain = report_page(PageKind::study, "a", R"({"title": "a"})");
  const std::string page = report_page(PageKind::study, hostile, R"({"title": ")" + hostile + R"("})");
  EXPECT_EQ(count(page, "<script"), count(plain, "<script"));
  EXPECT_EQ(count(page, "</script"), count(plain, "</script"));
  EXPECT_EQ(count(page, "<!--"), count(plain, "<!--"));
  EXPECT_EQ(count(page, "<title>"), 1U);
  // Placeholders in data stay as they are.
  EXPECT_EQ(count(page, "{{scripts}}"), 2U);
}

TEST(Page, NamesNoAddressOfTheNetwork) {
  const std::string page = report_page(PageKind::study, "a", "{}");
  for (const char* what : {" src=", "@import", "url(", "href=\"http"})
    EXPECT_EQ(count(page, what), 0U) << what;
}

TEST(Page, OfARunHasThreeOrIsRefused) {
  if (has_three()) {
    EXPECT_GT(report_page(PageKind::run, "a", "{}").size(), 500'000U);
  } else {
    EXPECT_THROW(report_page(PageKind::run, "a", "{}"), Error);
  }
}

TEST(ShellWord, IsQuotedWhereAShellWouldReadIt) {
  EXPECT_EQ(shell_word("out/a-1.yaml"), "out/a-1.yaml");
  EXPECT_EQ(shell_word("a b"), "'a b'");
  EXPECT_EQ(shell_word("it's"), "'it'\\''s'");
  EXPECT_EQ(shell_word("$(x)"), "'$(x)'");
  EXPECT_EQ(shell_word(""), "''");
}

}  // namespace
}  // namespace handsim::output
