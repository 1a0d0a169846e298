BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0011');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('ce2e6a280fdc477ebc36ea70925e4e19','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('190a3079206244a5a66aff4656dd1933','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE audit (
	number INTEGER NOT NULL, 
	at FLOAT NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	address VARCHAR(64) NOT NULL, details TEXT, 
	CONSTRAINT pk_audit PRIMARY KEY (number)
);
INSERT INTO "audit" VALUES(1,1795810365.20399,'cancel-job','alice','6b26cde657594c67a87cde54f9895469','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.79581036520801329619e+09,'delete-job','alice','6b26cde657594c67a87cde54f9895469',NULL,'command line',NULL);
CREATE TABLE datasets (
	owner VARCHAR(64) NOT NULL, 
	id VARCHAR(48) NOT NULL, 
	name VARCHAR(255) NOT NULL, 
	suffix VARCHAR(16) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	bytes BIGINT NOT NULL, 
	preview TEXT NOT NULL, 
	created FLOAT NOT NULL, summary TEXT, deleted FLOAT, source TEXT, idle_since FLOAT, 
	CONSTRAINT pk_datasets PRIMARY KEY (owner, id)
);
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79581036494299769402e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL,'https://example.org/a.csv',NULL);
CREATE TABLE deliveries (
	id VARCHAR(32) NOT NULL, 
	webhook_id VARCHAR(32) NOT NULL, 
	event VARCHAR(32) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	body TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	attempts INTEGER NOT NULL, 
	next_at FLOAT, 
	attempted FLOAT, 
	delivered FLOAT, 
	status INTEGER, 
	error TEXT, 
	CONSTRAINT pk_deliveries PRIMARY KEY (id), 
	CONSTRAINT fk_deliveries_webhook_id FOREIGN KEY(webhook_id) REFERENCES webhooks (id) ON DELETE CASCADE
);
INSERT INTO "deliveries" VALUES('551aa52579c1455d8b9d9f25ad72acbc','b6e0ed8923414a0297ed97466b16a0db','job.succeeded','ce2e6a280fdc477ebc36ea70925e4e19','{"type":"job.succeeded","timestamp":"2026-11-27T20:12:45.094+00:00","data":{"job":"ce2e6a280fdc477ebc36ea70925e4e19","kind":"identification","name":"it''s done; really","state":"succeeded","links":{"job":"/v1/jobs/ce2e6a280fdc477ebc36ea70925e4e19","result":"/v1/jobs/ce2e6a280fdc477ebc36ea70925e4e19/result","report":"/v1/jobs/ce2e6a280fdc477ebc36ea70925e4e19/report"}}}',1.79581036509499835968e+09,0,1.79581036509499835968e+09,NULL,NULL,NULL,NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('28075a9b1ad644a88d7bb9f3d4097f66',1,'queued','{}',1.79581036499900221822e+09);
INSERT INTO "events" VALUES('28075a9b1ad644a88d7bb9f3d4097f66',2,'cancelled','{}',1.79581036501698637014e+09);
INSERT INTO "events" VALUES('ce2e6a280fdc477ebc36ea70925e4e19',1,'queued','{}',1.79581036503999972339e+09);
INSERT INTO "events" VALUES('ce2e6a280fdc477ebc36ea70925e4e19',2,'running','{"attempt": 1}',1.79581036506301307677e+09);
INSERT INTO "events" VALUES('ce2e6a280fdc477ebc36ea70925e4e19',3,'progress','{"generation": 3}',1.79581036507701420788e+09);
INSERT INTO "events" VALUES('ce2e6a280fdc477ebc36ea70925e4e19',4,'succeeded','{"best": 0.5}',1.79581036509499835968e+09);
INSERT INTO "events" VALUES('190a3079206244a5a66aff4656dd1933',1,'queued','{}',1.79581036513599610329e+09);
INSERT INTO "events" VALUES('190a3079206244a5a66aff4656dd1933',2,'running','{"attempt": 1}',1.79581036515100288392e+09);
INSERT INTO "events" VALUES('190a3079206244a5a66aff4656dd1933',3,'progress','{"generation": 3}',1.79581036516299247739e+09);
INSERT INTO "events" VALUES('190a3079206244a5a66aff4656dd1933',4,'failed','{"type": "broken", "detail": "it broke"}',1.79581036517200469965e+09);
INSERT INTO "events" VALUES('999e2d78c7344856aaf4256a0d958620',1,'queued','{}',1.79581036519099473958e+09);
INSERT INTO "events" VALUES('999e2d78c7344856aaf4256a0d958620',2,'cancelled','{}',1.7958103651990010738e+09);
INSERT INTO "events" VALUES('4ee9febf32534eb191c087bdc14ad97f',1,'queued','{}',1.79581036520901918414e+09);
INSERT INTO "events" VALUES('4ee9febf32534eb191c087bdc14ad97f',2,'running','{"attempt": 1}',1.79581036521099066732e+09);
INSERT INTO "events" VALUES('4ee9febf32534eb191c087bdc14ad97f',3,'progress','{"generation": 5}',1.79581036521199655531e+09);
INSERT INTO "events" VALUES('0d32d370d1214913a58900a0060911ba',1,'queued','{}',1.79581036521400809287e+09);
CREATE TABLE jobs (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255), 
	priority INTEGER NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	version BIGINT NOT NULL, 
	attempt INTEGER NOT NULL, 
	stalled INTEGER NOT NULL, 
	lease_owner VARCHAR(128), 
	lease_epoch BIGINT NOT NULL, 
	lease_until FLOAT NOT NULL, 
	cancel_requested BOOLEAN NOT NULL, 
	progress TEXT, 
	checkpoint VARCHAR(64), 
	summary TEXT, 
	problem TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	started FLOAT, 
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, islands INTEGER DEFAULT 1 NOT NULL, monitor_id VARCHAR(32), record_number BIGINT, run_seconds FLOAT DEFAULT 0 NOT NULL, max_run_seconds BIGINT, tags TEXT DEFAULT '' NOT NULL, search_labels TEXT DEFAULT '' NOT NULL, search_result TEXT DEFAULT '' NOT NULL, dataset_name VARCHAR(255), model_error FLOAT, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('28075a9b1ad644a88d7bb9f3d4097f66','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79581036499900221822e+09,1.79581036501698637014e+09,NULL,1.79581036501698637014e+09,'0.1.0',NULL,NULL,0.0,'',1,'bb63a9362f8642dca6f581b4711b4c04',1,0.0,NULL,'','
','',NULL,NULL);
INSERT INTO "jobs" VALUES('ce2e6a280fdc477ebc36ea70925e4e19','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79581396506301307677e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.79581036503999972339e+09,1.79581036509499835968e+09,1.79581036506301307677e+09,1.79581036509499835968e+09,'0.1.0','0.1.0','0.1.0',0.0,'',1,NULL,NULL,0.0,NULL,'','it''s done; really
','',NULL,NULL);
INSERT INTO "jobs" VALUES('190a3079206244a5a66aff4656dd1933','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79581396515100288392e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79581036513599610329e+09,1.79581036517200469965e+09,1.79581036515100288392e+09,1.79581036517200469965e+09,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL,0.0,NULL,'','it''s done; really
','',NULL,NULL);
INSERT INTO "jobs" VALUES('999e2d78c7344856aaf4256a0d958620','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79581036519099473958e+09,1.7958103651990010738e+09,NULL,1.7958103651990010738e+09,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL,0.0,NULL,'','
','',NULL,NULL);
INSERT INTO "jobs" VALUES('4ee9febf32534eb191c087bdc14ad97f','alice','identification','','{"seed": 7}','a67a554034db15d7f73dda2a799c5c9614239099cea2418d61d6af96df538230',NULL,-7,'running',3,1,0,'4204d5df7bc24ea9bd60ee7922836f3e',1,1.79581036421099066733e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79581036520901918414e+09,1.79581036521199655531e+09,1.79581036521099066732e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL,0.0,NULL,',rig 2,','
rig 2
','',NULL,NULL);
INSERT INTO "jobs" VALUES('0d32d370d1214913a58900a0060911ba','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79581036521400809287e+09,1.79581036521400809287e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL,0.0,NULL,'','
','',NULL,NULL);
CREATE TABLE keys (
	id VARCHAR(16) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	secret_sha256 VARCHAR(64) NOT NULL, 
	scopes TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	expires FLOAT, 
	revoked FLOAT, 
	CONSTRAINT pk_keys PRIMARY KEY (id), 
	CONSTRAINT uq_keys_secret_sha256 UNIQUE (secret_sha256)
);
INSERT INTO "keys" VALUES('9e53c4086eb8c89a','alice','revoked','1a6437f804ed5e766cb0828528773bc2f3c97b5619dc1607709562452d049e54','["read", "write"]',1.79581036490401172635e+09,1.79581396490401172636e+09,1.79581036492799067496e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('ce2e6a280fdc477ebc36ea70925e4e19',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('ce2e6a280fdc477ebc36ea70925e4e19',2,'{"fitness": 0.7}','second');
CREATE TABLE monitor_records (
	monitor_id VARCHAR(32) NOT NULL, 
	is_rejected BOOLEAN NOT NULL, 
	place BIGINT NOT NULL, 
	name TEXT NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	state TEXT NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_monitor_records PRIMARY KEY (monitor_id, is_rejected, place), 
	CONSTRAINT fk_monitor_records_monitor_id_monitors FOREIGN KEY(monitor_id) REFERENCES monitors (id) ON DELETE CASCADE
);
INSERT INTO "monitor_records" VALUES('bb63a9362f8642dca6f581b4711b4c04',0,0,'record 4','0000000000000000000000000000000000000000000000000000000000000004','4','{"index": 0, "name": "record 4", "sha256": "0000000000000000000000000000000000000000000000000000000000000004"}');
CREATE TABLE monitors (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	priority INTEGER NOT NULL, 
	version BIGINT NOT NULL, 
	submitted BIGINT NOT NULL, 
	status VARCHAR(16) NOT NULL, 
	records BIGINT NOT NULL, 
	alarms BIGINT NOT NULL, 
	state TEXT, 
	document TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	islands_version VARCHAR(64), start BIGINT DEFAULT 0 NOT NULL, last_alarm TEXT, 
	CONSTRAINT pk_monitors PRIMARY KEY (id)
);
INSERT INTO "monitors" VALUES('bb63a9362f8642dca6f581b4711b4c04','alice','press','{"input": "u"}',0,1,1,'normal',1,0,'{"schema": "islands.monitor-head/1", "state": {"records": []}, "rejected": []}','{"count": 1}',1.79581036496999406817e+09,1.79581036502700448036e+09,'0.1.0',0,NULL);
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, dataset_retention BIGINT, max_islands BIGINT, max_run_seconds BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('ce2e6a280fdc477ebc36ea70925e4e19',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('190a3079206244a5a66aff4656dd1933',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('4ee9febf32534eb191c087bdc14ad97f',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('ce2e6a280fdc477ebc36ea70925e4e19','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','6b26cde657594c67a87cde54f9895469','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79581036520298433301e+09);
CREATE TABLE webhooks (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	url TEXT NOT NULL, 
	events TEXT NOT NULL, 
	secret VARCHAR(64) NOT NULL, 
	created FLOAT NOT NULL, 
	busy_until FLOAT DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_webhooks PRIMARY KEY (id)
);
INSERT INTO "webhooks" VALUES('b6e0ed8923414a0297ed97466b16a0db','alice','https://hooks.example.org/a','["job.succeeded"]','whsec_sr80fCQKwyQJoLWob1IEFUUooYYvHtVxb3IVYrv6B4I=',1.79581036496098184586e+09,0.0);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_webhooks_owner ON webhooks (owner);
CREATE INDEX ix_deliveries_webhook_id_next_at ON deliveries (webhook_id, next_at);
CREATE INDEX ix_deliveries_webhook_id_created ON deliveries (webhook_id, created);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id, islands);
CREATE INDEX ix_monitors_owner_created_id ON monitors (owner, created, id);
CREATE INDEX ix_jobs_monitor ON jobs (monitor_id, state, record_number) WHERE monitor_id IS NOT NULL;
CREATE INDEX ix_monitor_records_monitor_id_sha256 ON monitor_records (monitor_id, sha256);
CREATE INDEX ix_jobs_model_error ON jobs (owner, model_error, id) WHERE model_error IS NOT NULL;
COMMIT;
