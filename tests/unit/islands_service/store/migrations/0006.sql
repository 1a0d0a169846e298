BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0006');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('d440ac3161cb4df89c958d652534fd21','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('247da2daf71f47309501094a41463a4f','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
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
INSERT INTO "audit" VALUES(1,1.79536287477201819424e+09,'cancel-job','alice','ffaa7e97d43842109555a5864949fa10','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.79536287477499532701e+09,'delete-job','alice','ffaa7e97d43842109555a5864949fa10',NULL,'command line',NULL);
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
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79536287473798084265e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL,'https://example.org/a.csv',NULL);
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
INSERT INTO "deliveries" VALUES('9804fea813b5400faa6ac63399fc0746','4e44b31af83140aa93a3263abaaa3aa6','job.succeeded','d440ac3161cb4df89c958d652534fd21','{"type":"job.succeeded","timestamp":"2026-11-22T15:54:34.756+00:00","data":{"job":"d440ac3161cb4df89c958d652534fd21","kind":"identification","name":"it''s done; really","state":"succeeded","links":{"job":"/v1/jobs/d440ac3161cb4df89c958d652534fd21","result":"/v1/jobs/d440ac3161cb4df89c958d652534fd21/result","report":"/v1/jobs/d440ac3161cb4df89c958d652534fd21/report"}}}',1.79536287475600528718e+09,0,1.79536287475600528718e+09,NULL,NULL,NULL,NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('d440ac3161cb4df89c958d652534fd21',1,'queued','{}',1795362874.74301);
INSERT INTO "events" VALUES('d440ac3161cb4df89c958d652534fd21',2,'running','{"attempt": 1}',1.79536287475101661681e+09);
INSERT INTO "events" VALUES('d440ac3161cb4df89c958d652534fd21',3,'progress','{"generation": 3}',1.79536287475298786159e+09);
INSERT INTO "events" VALUES('d440ac3161cb4df89c958d652534fd21',4,'succeeded','{"best": 0.5}',1.79536287475600528718e+09);
INSERT INTO "events" VALUES('247da2daf71f47309501094a41463a4f',1,'queued','{}',1.79536287476099443429e+09);
INSERT INTO "events" VALUES('247da2daf71f47309501094a41463a4f',2,'running','{"attempt": 1}',1.79536287476300597193e+09);
INSERT INTO "events" VALUES('247da2daf71f47309501094a41463a4f',3,'progress','{"generation": 3}',1.79536287476401185993e+09);
INSERT INTO "events" VALUES('247da2daf71f47309501094a41463a4f',4,'failed','{"type": "broken", "detail": "it broke"}',1.79536287476598310471e+09);
INSERT INTO "events" VALUES('6e7905c4de384a4690e9487f3ee19803',1,'queued','{}',1.79536287476799488065e+09);
INSERT INTO "events" VALUES('6e7905c4de384a4690e9487f3ee19803',2,'cancelled','{}',1.7953628747700066566e+09);
INSERT INTO "events" VALUES('dfea2b5487e547298b63987e87a589b0',1,'queued','{}',1.79536287477600121497e+09);
INSERT INTO "events" VALUES('dfea2b5487e547298b63987e87a589b0',2,'running','{"attempt": 1}',1.79536287477801299091e+09);
INSERT INTO "events" VALUES('dfea2b5487e547298b63987e87a589b0',3,'progress','{"generation": 5}',1.79536287477901887891e+09);
INSERT INTO "events" VALUES('790ef4c04dca4a35912a4cf5a575db3e',1,'queued','{}',1.79536287477998447422e+09);
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
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('d440ac3161cb4df89c958d652534fd21','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79536647475101661681e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1795362874.74301,1.79536287475600528718e+09,1.79536287475101661681e+09,1.79536287475600528718e+09,'0.1.0','0.1.0','0.1.0',0.0,'');
INSERT INTO "jobs" VALUES('247da2daf71f47309501094a41463a4f','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79536647476300597193e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79536287476099443429e+09,1.79536287476598310471e+09,1.79536287476300597193e+09,1.79536287476598310471e+09,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('6e7905c4de384a4690e9487f3ee19803','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79536287476799488065e+09,1.7953628747700066566e+09,NULL,1.7953628747700066566e+09,'0.1.0',NULL,NULL,0.0,'');
INSERT INTO "jobs" VALUES('dfea2b5487e547298b63987e87a589b0','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,0,'4737c95948004a8e8ca926a406afc9d8',1,1.79536287377801299092e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79536287477600121497e+09,1.79536287477901887891e+09,1.79536287477801299091e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'');
INSERT INTO "jobs" VALUES('790ef4c04dca4a35912a4cf5a575db3e','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79536287477998447422e+09,1.79536287477998447422e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'');
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
INSERT INTO "keys" VALUES('5250122c1736d495','alice','revoked','f2f9fdbdd1b17c6b756bbbac65b13c9b2a3d16ace70e8b06eb0ce2292b947955','["read", "write"]',1.79536287473299217224e+09,1.7953664747329921722e+09,1.79536287473600959774e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('d440ac3161cb4df89c958d652534fd21',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('d440ac3161cb4df89c958d652534fd21',2,'{"fitness": 0.7}','second');
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, dataset_retention BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('d440ac3161cb4df89c958d652534fd21',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('247da2daf71f47309501094a41463a4f',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('dfea2b5487e547298b63987e87a589b0',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('d440ac3161cb4df89c958d652534fd21','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','ffaa7e97d43842109555a5864949fa10','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79536287477201819424e+09);
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
INSERT INTO "webhooks" VALUES('4e44b31af83140aa93a3263abaaa3aa6','alice','https://hooks.example.org/a','["job.succeeded"]','whsec_WOEgyqHP0yMRyonKLgvHVSoBFx8h+H28Ps4SP6Y7Zc0=',1.79536287473999261856e+09,0.0);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id);
CREATE INDEX ix_webhooks_owner ON webhooks (owner);
CREATE INDEX ix_deliveries_webhook_id_next_at ON deliveries (webhook_id, next_at);
CREATE INDEX ix_deliveries_webhook_id_created ON deliveries (webhook_id, created);
COMMIT;
