// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>

#include "core/sqlite.h"
#include "core/types.h"

namespace adasfm {

// Ids and names of a database's images. Tables of priors refer to images by
// name, since names stay when ids are assigned anew.
class ImageNames {
 public:
  // Throws SqliteError.
  explicit ImageNames(SqliteConnection* database);

  // Throws SqliteError when the database has no such image.
  const std::string& Name(image_t image_id) const;

  // None when the database has no image of this name.
  std::optional<image_t> Id(const std::string& name) const;

  // The ids of the names in the first two selected columns.
  std::optional<std::pair<image_t, image_t>> Ids(
      const SqliteStatement& statement) const;

  // Binds ids and names as the first four values of a row.
  void BindPair(image_t image_id1, image_t image_id2,
                SqliteStatement* statement) const;

 private:
  std::map<image_t, std::string> names_;
  std::map<std::string, image_t> ids_;
};

}  // namespace adasfm
