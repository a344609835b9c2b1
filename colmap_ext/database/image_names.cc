// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/image_names.h"

#include "colmap_ext/host/database.h"

namespace adasfm {

ImageNames::ImageNames(SqliteConnection* database) {
  for (const DatabaseImage& image : ReadImages(database)) {
    names_[image.image_id] = image.name;
    ids_[image.name] = image.image_id;
  }
}

const std::string& ImageNames::Name(image_t image_id) const {
  const auto name = names_.find(image_id);
  if (name != names_.end()) return name->second;
  throw SqliteError("no image with the id " + std::to_string(image_id));
}

std::optional<image_t> ImageNames::Id(const std::string& name) const {
  const auto id = ids_.find(name);
  if (id == ids_.end()) return std::nullopt;
  return id->second;
}

std::optional<std::pair<image_t, image_t>> ImageNames::Ids(
    const SqliteStatement& statement) const {
  const std::optional<image_t> id1 = Id(statement.Text(0));
  const std::optional<image_t> id2 = Id(statement.Text(1));
  if (id1 && id2) return std::make_pair(*id1, *id2);
  return std::nullopt;
}

void ImageNames::BindPair(image_t image_id1, image_t image_id2,
                          SqliteStatement* statement) const {
  statement->BindInt(1, image_id1);
  statement->BindInt(2, image_id2);
  statement->BindText(3, Name(image_id1));
  statement->BindText(4, Name(image_id2));
}

}  // namespace adasfm
